"""Turns a solved pose into a :class:`Registration`: measures, covariance, predicted errors, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import RegistrationError
from picoradar.registration.least_squares import information, plane_rows
from picoradar.registration.measures import residual_measures
from picoradar.registration.refine import dispersion
from picoradar.registration.scan import INDEPENDENT_POINTS, Scan
from picoradar.registration.se3 import transform
from picoradar.registration.solution import Solution
from picoradar.registration.trust.covariance import (
    Stiffness,
    Target,
    describe_weakness,
    patch_misfit_mm,
    quantile_mm,
    stiffness,
    target_covariance,
)
from picoradar.registration.trust.result import Registration
from picoradar.registration.trust.verdict import Evidence, Tolerance, judge

PLAUSIBLE = 20.0
"""Difference of the log likelihood below which a rival may be the truth: neighbours are not independent."""

PATCH_POINTS = 8
"""Neighbours that share a departure of the model from the points."""

FREE_MM = 1e3
"""A motion whose predicted standard deviation exceeds this is called free."""


@dataclass(frozen=True)
class Asked:
    """What the caller asks: where the error matters, how large it may be, the range bias to reckon with."""

    targets: npt.ArrayLike | Sequence[dict[str, Any]] | None
    tolerance: Tolerance
    range_bias_mm: float


def assess(scan: Scan, solution: Solution, asked: Asked, findings: list[str]) -> Registration:
    """Measure, predict and judge a solution.

    The covariance is that of the plane form, inflated where the residuals are larger than predicted, and by the share
    of points left out: which points are bone was decided by the same data. Minima beside the solution add their
    distances. (Measured on simulated scans, squared errors
    are 0.7 to 1.1 times those predicted so; without the share they are 0.7 to 2.4 times.)
    """
    inliers, closest = solution.inliers, solution.closest
    enough = int(inliers.sum()) >= 6
    used = inliers if enough else np.ones(len(scan), dtype=np.bool_)
    moved = transform(solution.model_from_scanner, scan.points[used])
    centre = moved.mean(axis=0)
    radius = float(np.sqrt(((moved - centre) ** 2).sum(axis=1).mean()))
    rotation = solution.model_from_scanner[:3, :3]
    sigma = solution.noise.plane_sigma(scan, rotation, closest.normals)
    rows = plane_rows(moved, closest.normals[used], centre)
    chi2 = float(np.mean((closest.signed_mm[used] / sigma[used]) ** 2))
    misfit = patch_misfit_mm(closest.signed_mm, used, solution.around)
    correlated = 1.0 + PATCH_POINTS * float(np.mean((misfit / sigma[used]) ** 2))
    inflation = max(1.0, chi2) * correlated * len(scan) / int(used.sum())
    covariance = pose_covariance(information(rows, sigma[used]), radius) * inflation
    covariance += dispersion(solution.model_from_scanner, solution.beside, centre)
    bias = bias_motion(rows, sigma[used], closest.normals[used], scan.beams[used] @ rotation.T, covariance)
    targets = [
        predict(name, position, covariance, centre, bias * asked.range_bias_mm)
        for name, position in named_targets(asked.targets, centre)
    ]
    rotation_sd = min(180.0, float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))))
    found = stiffness(rows, sigma[used], radius)
    measures = residual_measures(closest.signed_mm[used])
    independent = min(len(scan), INDEPENDENT_POINTS)
    evidence = Evidence(
        rotation_sd_deg=rotation_sd,
        targets=targets,
        points=len(scan),
        inliers=int(inliers.sum()),
        inside_share=float(np.mean(closest.signed_mm < -4.0 * np.maximum(sigma, 0.25))),
        misfit_mm=misfit,
        rivals=[r for r in solution.rivals if (r.cost - solution.cost) * independent < PLAUSIBLE],
        sure=solution.sure,
    )
    verdict, reasons = judge(evidence, asked.tolerance)
    return Registration(
        model_from_scanner=solution.model_from_scanner,
        covariance=covariance,
        centre=centre,
        verdict=verdict,
        reasons=reasons,
        inliers=inliers,
        residuals=closest.signed_mm,
        rms_mm=measures.rms_mm,
        mean_mm=measures.mean_mm,
        max_mm=measures.max_mm,
        nlse=measures.nlse,
        targets=targets,
        predicted_rotation_deg=rotation_sd,
        weak_directions=weak_directions(found, covariance, centre),
        rivals=solution.rivals,
        history=solution.history,
        cost=solution.cost,
        method=solution.method,
        noise_mm=solution.noise.range_mm,
        misfit_mm=misfit,
        findings=findings,
    )


def pose_covariance(h: FloatArray, radius_mm: float) -> FloatArray:
    """Inverse of an information matrix, with motions that are free given the standard deviation `FREE_MM`."""
    scale = np.array([1.0 / radius_mm] * 3 + [1.0] * 3)
    values, vectors = np.linalg.eigh(h * np.outer(scale, scale))
    variance = 1.0 / np.maximum(values, FREE_MM**-2)
    return np.asarray((vectors * variance) @ vectors.T * np.outer(scale, scale), dtype=np.float64)


def bias_motion(
    rows: FloatArray, sigma: FloatArray, normals: FloatArray, beams: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Motion (6,) that a range error of 1 mm common to all points causes: ``Cov sum g_i (n_i . u_i) / sigma_i^2``."""
    along = np.einsum("ij,ij->i", normals, beams)
    return np.asarray(covariance @ (rows.T @ (along / sigma**2)), dtype=np.float64)


def predict(name: str, position: FloatArray, covariance: FloatArray, centre: FloatArray, bias: FloatArray) -> Target:
    """Predict the error at one target from the pose's covariance and a bias motion (6,)."""
    spread = target_covariance(covariance, centre, position)
    shift = bias[3:] + np.cross(bias[:3], position - centre)
    return Target(
        name=name,
        position=position,
        rms_mm=float(np.sqrt(np.trace(spread))),
        p95_mm=quantile_mm(spread),
        bias_mm=float(np.linalg.norm(shift)),
    )


def named_targets(
    targets: npt.ArrayLike | Sequence[dict[str, Any]] | None, centre: FloatArray
) -> list[tuple[str, FloatArray]]:
    """Names and positions; without targets, the centre of the registered cloud stands in.

    Raises
    ------
    RegistrationError
        If targets are neither (M, 3) nor dicts with "position".
    """
    if targets is None:
        return [("centre of the cloud", centre)]
    if isinstance(targets, Sequence) and len(targets) > 0 and isinstance(targets[0], dict):
        try:
            return [
                (str(t.get("name", f"target {i + 1}")), np.asarray(t["position"], dtype=np.float64).reshape(3))
                for i, t in enumerate(targets)
            ]
        except (KeyError, ValueError) as error:
            raise RegistrationError(
                f'a target is a dict with "position": [x, y, z] in mm and "name" ({error})'
            ) from error
    positions = np.asarray(targets, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise RegistrationError(f"targets have shape {positions.shape}: give finite (M, 3) in the model frame, mm")
    return [(f"target {i + 1}", p) for i, p in enumerate(positions)]


def weak_directions(found: Stiffness, covariance: FloatArray, centre: FloatArray, count: int = 2) -> list[str]:
    """Describe the `count` worst-held motions, worst first."""
    scale = np.array([found.radius_mm] * 3 + [1.0] * 3)
    scaled = covariance * np.outer(scale, scale)
    variances, motions = np.linalg.eigh(scaled)
    return [
        describe_weakness(found, motions[:, -1 - k], centre, float(np.sqrt(variances[-1 - k]))) for k in range(count)
    ]
