"""Turns a solved pose into a :class:`Registration`: measures, covariance, predicted errors, verdict.

Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.errors import RegistrationError
from picoradar.registration.least_squares import information, plane_rows
from picoradar.registration.refine import dispersion
from picoradar.registration.scan import MIN_POINTS, Scan
from picoradar.registration.se3 import displacement_covariance, transform
from picoradar.registration.settings import RobustSettings
from picoradar.registration.solution import Solution, residual_measures
from picoradar.registration.trust.covariance import (
    Stiffness,
    Target,
    describe_weakness,
    patch_misfit_mm,
    quantile_mm,
    stiffness,
)
from picoradar.registration.trust.result import Registration
from picoradar.registration.trust.verdict import Evidence, Objection, Tolerance, judge


@dataclass(frozen=True)
class RegistrationRequest:
    """What the caller asks: where the error matters, how large it may be, and the standard deviation of a range error
    common to all points (None: never measured); and what speaks against the points."""

    targets: npt.ArrayLike | Sequence[dict[str, Any]] | None
    tolerance: Tolerance
    range_bias_mm: float | None
    objections: Sequence[Objection] = ()


def assess(
    scan: Scan, solution: Solution, request: RegistrationRequest, findings: list[str], settings: RobustSettings
) -> Registration:
    """Measure, predict and judge a solution.

    Parameters
    ----------
    scan : Scan
    solution : Solution
    request : RegistrationRequest
    findings : list of sentences
        What validation of the model found.
    settings : RobustSettings
    """
    fit = _Assessed.of(scan, solution, settings)
    used, closest = fit.used, solution.closest
    normals, beams = closest.normals[used], scan.beams[used] @ solution.model_from_scanner[:3, :3].T
    range_sd_mm = math.nan if request.range_bias_mm is None else request.range_bias_mm
    bias = bias_motion(fit.rows, fit.sigma[used], normals, beams, fit.uninflated) * range_sd_mm
    targets = [
        predict(name, position, fit, bias, settings.trust.bias_sds)
        for name, position in named_targets(request.targets, fit.centre)
    ]
    evidence = replace(_evidence(scan, solution, fit, targets, settings), objections=request.objections)
    verdict, reasons = judge(evidence, request.tolerance, settings.trust)
    measures = residual_measures(closest.signed_mm[used])
    return Registration(
        model_from_scanner=solution.model_from_scanner,
        covariance=fit.covariance,
        centre=fit.centre,
        verdict=verdict,
        reasons=reasons,
        inliers=solution.inliers,
        residuals=closest.signed_mm,
        rms_mm=measures.rms_mm,
        mean_mm=measures.mean_mm,
        max_mm=measures.max_mm,
        nlse=measures.nlse,
        targets=targets,
        predicted_rotation_deg=evidence.rotation_sd_deg,
        weak_directions=weak_directions(
            stiffness(fit.rows, fit.sigma[used], fit.radius_mm), fit.covariance, fit.centre
        ),
        rivals=solution.rivals,
        history=solution.history,
        cost=solution.cost,
        method=solution.method,
        noise_mm=solution.noise.range_mm,
        misfit_mm=fit.misfit_mm,
        findings=findings,
    )


@dataclass(frozen=True)
class _Assessed:
    """A solution's covariance [eq. 10] with what it is made of.

    Attributes
    ----------
    used : (N,) array of bool
        The inliers; all points where these are too few for a pose.
    centre : (3,) array
    radius_mm : float
        Root mean square distance of the points used from it.
    sigma : (N,) array
    rows : (M, 6) array
        Of the points used.
    misfit_mm : float
    covariance : (6, 6) array
    uninflated : (6, 6) array
        Inverse of the information alone: how the pose follows what all points share.
    """

    used: BoolArray
    centre: FloatArray
    radius_mm: float
    sigma: FloatArray
    rows: FloatArray
    misfit_mm: float
    covariance: FloatArray
    uninflated: FloatArray

    @classmethod
    def of(cls, scan: Scan, solution: Solution, settings: RobustSettings) -> _Assessed:
        """Covariance of the plane form, inflated for what residuals and patches show, with the alternatives' spread.

        By the share of points left out, too: which points are bone was decided by the same data. (Measured on simulated
        scans, squared errors are 0.7 to 1.1 times those predicted so; without the share they are 0.7 to 2.4 times.)
        """
        trust, closest = settings.trust, solution.closest
        enough = int(solution.inliers.sum()) >= MIN_POINTS
        used = solution.inliers if enough else np.ones(len(scan), dtype=np.bool_)
        moved = transform(solution.model_from_scanner, scan.points[used])
        centre = moved.mean(axis=0)
        radius = float(np.sqrt(((moved - centre) ** 2).sum(axis=1).mean()))
        sigma = solution.noise.plane_sigma(scan, solution.model_from_scanner[:3, :3], closest.normals)
        rows = plane_rows(moved, closest.normals[used], centre)
        chi2 = float(np.mean((closest.signed_mm[used] / sigma[used]) ** 2))
        misfit = patch_misfit_mm(closest.signed_mm, used, solution.around, trust.patch_min_neighbours)
        correlated = 1.0 + trust.patch_points * float(np.mean((misfit / sigma[used]) ** 2))
        inflation = max(1.0, chi2) * correlated * len(scan) / int(used.sum())
        uninflated = pose_covariance(information(rows, sigma[used]), radius, trust.free_mm)
        covariance = uninflated * inflation + dispersion(solution.model_from_scanner, solution.alternatives, centre)
        return cls(used, centre, radius, sigma, rows, misfit, covariance, uninflated)


def _evidence(
    scan: Scan, solution: Solution, fit: _Assessed, targets: list[Target], settings: RobustSettings
) -> Evidence:
    trust = settings.trust
    independent = min(len(scan), settings.tissue.independent_points)
    deep_inside = -trust.inside_sigmas * np.maximum(fit.sigma, trust.inside_min_sigma_mm)
    return Evidence(
        rotation_sd_deg=min(180.0, float(np.degrees(np.sqrt(np.trace(fit.covariance[:3, :3]))))),
        targets=targets,
        points=len(scan),
        inliers=int(solution.inliers.sum()),
        inside_share=float(np.mean(solution.closest.signed_mm < deep_inside)),
        beside_share=solution.beside_share,
        misfit_mm=fit.misfit_mm,
        rivals=[r for r in solution.rivals if (r.cost - solution.cost) * independent < trust.plausible_nats],
        confident=solution.confident,
        range_error_known=all(math.isfinite(target.bias_mm) for target in targets),
    )


def pose_covariance(h: FloatArray, radius_mm: float, free_mm: float) -> FloatArray:
    """Inverse of an information matrix (6, 6), with motions that are free given the standard deviation `free_mm`."""
    scale = np.array([1.0 / radius_mm] * 3 + [1.0] * 3)
    values, vectors = np.linalg.eigh(h * np.outer(scale, scale))
    variance = 1.0 / np.maximum(values, free_mm**-2)
    return np.asarray((vectors * variance) @ vectors.T * np.outer(scale, scale), dtype=np.float64)


def bias_motion(
    rows: FloatArray, sigma: FloatArray, normals: FloatArray, beams: FloatArray, uninflated: FloatArray
) -> FloatArray:
    """Motion (6,) that a range error of 1 mm common to all points causes: ``H^-1 sum g_i (n_i . u_i) / sigma_i^2``.

    Parameters
    ----------
    rows, sigma, normals, beams : (M, 6), (M,), (M, 3), (M, 3) arrays
        Of the points used, model frame.
    uninflated : (6, 6) array
        Inverse of the information H of just these rows. What inflates a covariance (misfit, points left out) says how
        far the pose may be off at random, not how far it follows a common error: with it, 1 mm came out as 18 mm.
    """
    along = np.einsum("ij,ij->i", normals, beams)
    return np.asarray(uninflated @ (rows.T @ (along / sigma**2)), dtype=np.float64)


def predict(name: str, position: FloatArray, fit: _Assessed, bias: FloatArray, bias_sds: float) -> Target:
    """Predict the error at one target from the pose's covariance and the motion (6,) by a common range error, of which
    `bias_sds` are stated."""
    spread = displacement_covariance(fit.covariance, position - fit.centre)
    shift = bias[3:] + np.cross(bias[:3], position - fit.centre)
    p95_mm, bias_mm = quantile_mm(spread), float(np.linalg.norm(shift))
    return Target(name, position, float(np.sqrt(np.trace(spread))), p95_mm, bias_mm, p95_mm + bias_sds * bias_mm)


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
        except (KeyError, TypeError, ValueError) as error:
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
