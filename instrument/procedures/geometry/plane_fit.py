"""Plane-constrained calibration: robust Levenberg-Marquardt over the scanner's parameters and the planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, GeometryUncertainty
from picoradar.instrument.procedures.geometry.planes import (
    COUNT,
    PARAMETERS,
    PLANE_SIZES,
    SIZES,
    Beams,
    FloatArray,
    PlaneScan,
    beams,
    errors_of,
    fitted_plane,
    noise_of,
    points,
    split,
    values_of,
)
from picoradar.instrument.procedures.station.certainty import STAGE_SD_MM, zero_sd_mm

OFFSET_SD_MM = STAGE_SD_MM
ROUNDS, STEPS = 6, 20
MIN_SCALE = 0.1  # of residuals to their noise: below, rounding would be taken for noise
CUT = 4.0  # standard deviations; loses 6e-5 of good points
CAUCHY = 2.385
KNOWN_SHARE = 1 / 3  # a parameter counts as identified when the planes leave a third of its prior uncertainty, or less


@dataclass(frozen=True)
class PlaneFit:
    """Result of the plane-constrained calibration.

    Attributes
    ----------
    values : (7,) float array
        Parameters in the order of `PARAMETERS`; those not identified hold what the calibration before had.
    covariance : (7, 7) float array
        Of the parameters, weak priors included.
    identified : (7,) bool array
        Which of them the poses identify.
    planes : (P, 3) float array
        Slopes and offset of each pose.
    inliers : (N,) bool array
    residuals_mm : (N,) float array
        Distances from the planes.
    sigma_mm : (N,) float array
        What ranging and pointing alone would give.
    noise_factor : float
        Standard deviation of the inliers' residuals in units of ``sigma_mm``.
    condition, condition_scaled : float
        Condition number of the residuals' derivatives by identified parameters and planes: in mm and rad as they are,
        and with each parameter in units of its size.
    """

    values: FloatArray
    covariance: FloatArray
    identified: NDArray[np.bool_]
    planes: FloatArray
    inliers: NDArray[np.bool_]
    residuals_mm: FloatArray
    sigma_mm: FloatArray
    noise_factor: float
    condition: float
    condition_scaled: float

    @property
    def sd(self) -> FloatArray:
        """Get the standard deviations (7,) of the parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def rms_mm(self) -> float:
        """Get the root mean square distance of the inliers from their planes."""
        return float(np.sqrt(np.mean(self.residuals_mm[self.inliers] ** 2)))

    @property
    def sd_mm(self) -> float:
        """Get the standard deviation of these distances, the estimated values counted off."""
        used = int(self.inliers.sum())
        free = used - self.planes.size - int(self.identified.sum())
        return float(self.rms_mm * np.sqrt(used / max(free, 1)))

    def applied_to(self, calibration: Calibration) -> Calibration:
        """Return the calibration with the identified parameters replaced."""
        return calibration.model_copy(
            update={
                "mirror_separation_mm": float(self.values[0]),
                "scanner": errors_of(self.values),
                "range_zero_mm": float(self.values[6]),
                "range_zero_sd_mm": zero_sd_mm(float(self.sd[6]))
                if self.identified[6]
                else calibration.range_zero_sd_mm,
                "geometry": self._uncertainty(),
            }
        )

    def _uncertainty(self) -> GeometryUncertainty:
        known = self.covariance[np.ix_(self.identified, self.identified)]
        return GeometryUncertainty(
            parameters=tuple(name for name, found in zip(PARAMETERS, self.identified, strict=True) if found),
            covariance=tuple(tuple(row) for row in known.tolist()),
        )


def fit_planes(scans: Sequence[PlaneScan], before: Calibration) -> PlaneFit:
    """Calibrate the scanner by scans of a flat plate.

    Least squares of the distances to the planes, weighted by ranging and pointing noise; Cauchy weights find the
    outliers, which are then left out beyond 4 robust standard deviations. Weak priors of the width `SIZES` hold what
    the planes do not tell, such as a turn of the whole frame.

    Parameters
    ----------
    scans : sequence of PlaneScan
        One for each pose.
    before : Calibration
        In force when the ranges were made; start of the fit.
    """
    prior = values_of(before)
    zero_mm = before.range_zero_mm
    vector = np.concatenate([prior, *(fitted_plane(points(scan, prior, zero_mm)) for scan in scans)])
    sizes = np.concatenate([SIZES, np.tile(PLANE_SIZES, len(scans))])
    for number in range(ROUNDS):
        seen = _seen(scans, vector, zero_mm)
        sigma = _noise(scans, seen, before)
        off = np.abs(np.concatenate([s.off_mm for s in seen])) / sigma
        scale = max(1.4826 * float(np.median(off)), MIN_SCALE)
        inliers = off < CUT * scale
        weights = inliers.astype(np.float64) if number >= ROUNDS // 2 else 1.0 / (1.0 + (off / (CAUCHY * scale)) ** 2)
        vector = _minimised(scans, vector, prior, zero_mm, np.sqrt(weights) / (scale * sigma), sizes)
    return _described(scans, vector, before, inliers, sizes)


def _minimised(
    scans: Sequence[PlaneScan],
    vector: FloatArray,
    prior: FloatArray,
    zero_mm: float,
    weights: FloatArray,
    sizes: FloatArray,
) -> FloatArray:
    """Levenberg-Marquardt in parameters divided by their sizes."""
    damping = 1e-3
    residual, rows = _system(scans, vector, prior, zero_mm, weights)
    for _ in range(STEPS):
        scaled = rows * sizes
        normal, gradient = scaled.T @ scaled, scaled.T @ residual
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -gradient) * sizes
        tried, tried_rows = _system(scans, vector + step, prior, zero_mm, weights)
        if tried @ tried <= residual @ residual:
            gained = residual @ residual - tried @ tried
            vector, residual, rows, damping = vector + step, tried, tried_rows, damping / 10
            if gained < 1e-4:
                break
        else:
            damping *= 10
    return vector


def _system(
    scans: Sequence[PlaneScan], vector: FloatArray, prior: FloatArray, zero_mm: float, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return residuals in standard deviations and their derivatives: points, then priors, then the stage's scale."""
    residual, rows = stacked(scans, vector, zero_mm)
    values, planes = split(vector)
    identity = np.eye(len(vector))
    reported = [(number, scan.offset_mm) for number, scan in enumerate(scans) if scan.offset_mm is not None]
    offsets = np.array([(planes[number, 2] - offset) / OFFSET_SD_MM for number, offset in reported])
    offset_rows = identity[[COUNT + 3 * number + 2 for number, _ in reported]] / OFFSET_SD_MM
    return (
        np.concatenate([residual * weights, (values - prior) / SIZES, offsets]),
        np.concatenate([rows * weights[:, None], identity[:COUNT] / SIZES[:, None], offset_rows]),
    )


def _described(
    scans: Sequence[PlaneScan],
    vector: FloatArray,
    before: Calibration,
    inliers: NDArray[np.bool_],
    sizes: FloatArray,
) -> PlaneFit:
    zero_mm, prior = before.range_zero_mm, values_of(before)
    residual, rows = stacked(scans, vector, zero_mm)
    seen = _seen(scans, vector, zero_mm)
    sigma, across = _noise(scans, seen, before), np.concatenate([s.across for s in seen])
    factor = max(float(np.sqrt(np.mean((residual[inliers] / sigma[inliers]) ** 2))), MIN_SCALE)
    _, system = _system(scans, vector, prior, zero_mm, inliers / (factor * sigma))
    scaled = system * sizes
    covariance = np.asarray(np.linalg.inv(scaled.T @ scaled), dtype=np.float64)[:COUNT, :COUNT] * np.outer(SIZES, SIZES)
    identified = np.sqrt(np.diag(covariance)) < KNOWN_SHARE * SIZES
    values, planes = split(vector)
    kept = np.concatenate([identified, np.ones(planes.size, dtype=bool)])
    triangle = np.linalg.qr(rows[inliers][:, kept], mode="r")
    return PlaneFit(
        values=np.where(identified, values, prior),
        covariance=covariance,
        identified=identified,
        planes=planes,
        inliers=inliers,
        residuals_mm=residual * across,
        sigma_mm=sigma * across,
        noise_factor=factor,
        condition=float(np.linalg.cond(triangle)),
        condition_scaled=float(np.linalg.cond(triangle * sizes[kept])),
    )


def stacked(scans: Sequence[PlaneScan], vector: FloatArray, zero_mm: float) -> tuple[FloatArray, FloatArray]:
    """Return the residuals (N,) in mm along the beams of all scans and their derivatives (N, 7 + 3 P)."""
    seen = _seen(scans, vector, zero_mm)
    rows = np.zeros((sum(len(s.off_mm) for s in seen), len(vector)))
    begin = 0
    for number, s in enumerate(seen):
        block = rows[begin : begin + len(s.off_mm)]
        block[:, :COUNT] = s.by_values
        block[:, COUNT + 3 * number : COUNT + 3 * number + 3] = s.by_plane
        begin += len(block)
    return np.concatenate([s.off_mm for s in seen]), rows


def _seen(scans: Sequence[PlaneScan], vector: FloatArray, zero_mm: float) -> list[Beams]:
    values, planes = split(vector)
    return [beams(scan, values, plane, zero_mm) for scan, plane in zip(scans, planes, strict=True)]


def _noise(scans: Sequence[PlaneScan], seen: Sequence[Beams], before: Calibration) -> FloatArray:
    return np.concatenate([noise_of(scan, s, before.pointing_sd_rad) for scan, s in zip(scans, seen, strict=True)])
