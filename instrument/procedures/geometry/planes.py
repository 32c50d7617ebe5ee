"""Points of a scanner with errors, on planes: residuals and their derivatives for the plane-constrained calibration.

A flat plate stands in several poses; where it stands is not known and is estimated too. For the point p of angles and
range with the parameters u, and the plane of its pose with unit normal n and offset d from the scanner's origin, the
constraint is ``n . p(u) - d = 0``, one equation a point, as for a tracker that is moved over a table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, ScannerErrors, jacobian, points_from, true_angles

FloatArray = NDArray[np.float64]

PARAMETERS = (
    "mirror_separation_mm",
    "x_scale",
    "y_scale",
    "x_offset_rad",
    "y_offset_rad",
    "non_orthogonality_rad",
    "range_zero_mm",
)
SIZES = np.array([5.0, 0.02, 0.02, 0.02, 0.02, 0.02, 5.0])
"""How far each parameter of a scanner as it is built may be off (standard deviation): scale of the parameters, and
the weak prior that holds what the planes do not tell."""
PLANE_SIZES = np.array([0.01, 0.01, 1.0])  # two slopes and the offset (mm) of a plane
COUNT = len(PARAMETERS)


@dataclass(frozen=True)
class PlaneScan:
    """Places on one pose of the plate.

    Attributes
    ----------
    angles_rad : (N, 2) array
        Optical angles that were asked for.
    range_mm : (N,) array
        Ranges by the calibration in force.
    variance_mm2 : (N,) array
        Of the ranges.
    offset_mm : float or None
        Distance of the plane from the scanner's origin where the stage's scale tells it: a plate square to the beam.
    """

    angles_rad: FloatArray
    range_mm: FloatArray
    variance_mm2: FloatArray
    offset_mm: float | None = None


def values_of(calibration: Calibration) -> FloatArray:
    """Return the parameters (7,) of a calibration in the order of `PARAMETERS`."""
    s = calibration.scanner
    return np.array(
        [
            calibration.mirror_separation_mm,
            s.x_scale,
            s.y_scale,
            s.x_offset_rad,
            s.y_offset_rad,
            s.non_orthogonality_rad,
            calibration.range_zero_mm,
        ]
    )


def errors_of(values: FloatArray) -> ScannerErrors:
    """Return the errors of the mirrors' angles among the parameters."""
    names = ("x_scale", "y_scale", "x_offset_rad", "y_offset_rad", "non_orthogonality_rad")
    return ScannerErrors(**{name: float(values[PARAMETERS.index(name)]) for name in names})


def points(scan: PlaneScan, values: FloatArray, zero_mm: float) -> FloatArray:
    """Return the points (N, 3) of a scan for some parameters; ``zero_mm`` is the range zero that its ranges have."""
    return points_from(true_angles(scan.angles_rad, errors_of(values)), scan.range_mm + values[6] - zero_mm, values[0])


@dataclass(frozen=True)
class Beams:
    """The beams of a scan and the plane of its pose.

    Attributes
    ----------
    points_mm : (N, 3) array
        Measured.
    off_mm : (N,) array
        Way along the beam from the plane to the measured point.
    across : (N,) array
        Share of such a way that is across the plane.
    by_values : (N, 7) array
        Derivatives of ``off_mm`` by the parameters.
    by_plane : (N, 3) array
        Derivatives of ``off_mm`` by the slopes and the offset of the plane.
    by_angles : (N, 2) array
        Derivatives of ``off_mm`` by the two optical angles.
    """

    points_mm: FloatArray
    off_mm: FloatArray
    across: FloatArray
    by_values: FloatArray
    by_plane: FloatArray
    by_angles: FloatArray


def beams(scan: PlaneScan, values: FloatArray, plane: FloatArray, zero_mm: float) -> Beams:
    """Follow the beams of a scan to a plane.

    The residual is taken along the beam, where the noise is, and its derivatives where the beam meets the plane:
    taken at the noisy points, noise and derivative would go together, and a fit could make its residuals smaller by
    turning the beams.
    """
    asked, normal = scan.angles_rad, normal_of(plane)
    angles, ranges = true_angles(asked, errors_of(values)), scan.range_mm + values[6] - zero_mm
    where = points_from(angles, ranges, values[0])
    along = jacobian(angles, ranges, values[0])[..., 2]
    across = along @ normal
    off = (where @ normal - plane[2]) / across
    by_x, by_y, _ = np.moveaxis(np.einsum("nij,i->nj", jacobian(angles, ranges - off, values[0]), normal), -1, 0)
    by_y, by_x = by_y / across, by_x / across
    shorter = (np.sin(angles[:, 1]) * normal[1] + np.cos(angles[:, 1]) * normal[2]) / across
    x, y = asked.T
    met = where - off[:, None] * along
    return Beams(
        points_mm=where,
        off_mm=off,
        across=across,
        by_values=np.column_stack([1.0 - shorter, by_x * x, by_y * y, by_x, by_y, by_y * x, np.ones(len(x))]),
        by_plane=np.column_stack([met @ normal_derivatives(plane), -np.ones(len(x))]) / across[:, None],
        by_angles=np.column_stack([by_x, by_y]),
    )


def noise_of(scan: PlaneScan, seen: Beams, pointing_sd_rad: float) -> FloatArray:
    """Return the standard deviations (N,) of ``off_mm`` that ranging and pointing give."""
    return np.asarray(np.sqrt(scan.variance_mm2 + pointing_sd_rad**2 * (seen.by_angles**2).sum(axis=1)))


def fitted_plane(points_mm: FloatArray) -> FloatArray:
    """Return slopes and offset (3,) of the plane ``z = a x + b y + c`` through points.

    Iteratively reweighted least squares with Cauchy weights.
    """
    design = np.column_stack([points_mm[:, 0], points_mm[:, 1], np.ones(len(points_mm))])
    weights = np.ones(len(points_mm))
    for _ in range(20):
        root = np.sqrt(weights)
        solution = np.linalg.lstsq(design * root[:, None], points_mm[:, 2] * root, rcond=None)[0]
        off = points_mm[:, 2] - design @ solution
        scale = 2.385 * 1.4826 * max(float(np.median(np.abs(off))), 1e-9)
        weights = 1.0 / (1.0 + (off / scale) ** 2)
    a, b, c = solution
    return np.array([a, b, c / np.sqrt(1.0 + a * a + b * b)])


def normal_of(plane: FloatArray) -> FloatArray:
    """Return the unit normal (3,) of a plane given by its slopes."""
    raw = np.array([-plane[0], -plane[1], 1.0])
    return np.asarray(raw / np.linalg.norm(raw))


def normal_derivatives(plane: FloatArray) -> FloatArray:
    """Return the derivatives (3, 2) of the unit normal by the two slopes."""
    normal = normal_of(plane)
    raw = np.array([[-1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]) * normal[2]
    return np.asarray(raw - np.outer(normal, normal @ raw))


def split(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return parameters (7,) and planes (P, 3) of the joint vector."""
    return vector[:COUNT], vector[COUNT:].reshape(-1, 3)
