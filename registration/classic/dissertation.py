"""The registration method of the dissertation (section 3.3.3): ICP, minima suppression and outlier elimination."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.classic.icp import IcpResult, icp
from picoradar.registration.model import Model, Surface, visible_shell
from picoradar.registration.scan import NoiseModel, Scan, estimated_range_noise
from picoradar.registration.se3 import pose, rotation_from_vector, transform
from picoradar.registration.settings import NoiseSettings
from picoradar.registration.solution import Iteration, Solution


@dataclass(frozen=True)
class DissertationSettings:
    """Parameters of the method, with the values of table 4.4 (bone scan to CT).

    Attributes
    ----------
    max_iterations : int
        Of one ICP run.
    tolerance_mm2 : float
        ICP stops when the mean square distance improves by less.
    suppression_runs : int
        Perturbed runs of minima suppression; 0 switches it off.
    perturbation_deg, perturbation_mm : float
        Bounds of the random perturbation: angle of the angle-axis form, and length of the translation.
    outlier_threshold_mm : float or None
        Residual above which a point is an outlier; None switches elimination off.
    outlier_fraction : float
        Share of the outliers removed in one pass, the largest first.
    accelerated : bool
        Besl and McKay's acceleration of each ICP run.
    seed : int
        Of the perturbations.
    """

    max_iterations: int = 200
    tolerance_mm2: float = 1e-9
    suppression_runs: int = 6
    perturbation_deg: float = 3.0
    perturbation_mm: float = 2.4
    outlier_threshold_mm: float | None = 1.0
    outlier_fraction: float = 0.10
    accelerated: bool = False
    seed: int = 0


@dataclass(frozen=True)
class DissertationResult:
    """Pose (4, 4), points still in use (N,) and the convergence history."""

    model_from_scanner: FloatArray
    used: BoolArray
    history: list[Iteration] = field(default_factory=list)


def register_dissertation(
    points: FloatArray, surface: Surface, start: FloatArray, settings: DissertationSettings | None = None
) -> DissertationResult:
    """Register by ICP with minima suppression, then eliminate outliers (dissertation, section 3.3.3).

    I. Run ICP to convergence (with minima suppression). II. Where residuals exceed the threshold, remove a fraction of
    these points. III. Repeat until none exceeds it.

    Parameters
    ----------
    points : (N, 3) array
        Scanner frame, mm.
    surface : Surface
    start : (4, 4) array
        `model_from_scanner`, from landmarks as a rule.
    settings : DissertationSettings, optional
    """
    s = settings or DissertationSettings()
    best = suppress_minima(points, surface, start, s)
    history = list(best.history)
    used = np.ones(len(points), dtype=np.bool_)
    # Near the end few outliers are left, and a share of them would round to none: one goes in every pass.
    while s.outlier_threshold_mm is not None:
        distances = np.abs(surface.closest(transform(best.model_from_scanner, points[used])).signed_mm)
        outliers = np.flatnonzero(distances > s.outlier_threshold_mm)
        if len(outliers) == 0:
            break
        count = max(1, round(s.outlier_fraction * len(outliers)))
        if used.sum() - count < 6:
            break
        worst = outliers[np.argsort(-distances[outliers], kind="stable")[:count]]
        used[np.flatnonzero(used)[worst]] = False
        best = icp(
            points[used],
            surface,
            best.model_from_scanner,
            max_iterations=s.max_iterations,
            tolerance_mm2=s.tolerance_mm2,
            accelerated=s.accelerated,
            stage="outlier elimination",
        )
        history.extend(best.history)
    return DissertationResult(best.model_from_scanner, used, history)


def solve_as_dissertation(
    scan: Scan, model: Model, start: FloatArray, noise_mm: float | None, settings: DissertationSettings | None = None
) -> Solution:
    """Register a scan to a model, ready to be assessed.

    A closed model is cut to what the scanner can see from the start; the dissertation's models were cut by hand.

    Parameters
    ----------
    scan : Scan
    model : Model
    start : (4, 4) array
        `model_from_scanner`.
    noise_mm : float or None
        Range noise for the predicted errors; estimated from the residuals when None.
    settings : DissertationSettings, optional
    """
    surface = model.surface
    if model.closed:
        towards = transform(start, scan.origin[None])[0] - transform(start, scan.points).mean(axis=0)
        surface = visible_shell(surface, towards)
    result = register_dissertation(scan.points, surface, start, settings)
    closest = surface.closest(transform(result.model_from_scanner, scan.points))
    typical = NoiseSettings()
    noise = noise_mm or estimated_range_noise(closest.signed_mm[result.used], typical.typical_range_mm, typical)
    return Solution(
        model_from_scanner=result.model_from_scanner,
        closest=closest,
        inliers=result.used,
        history=result.history,
        rivals=[],
        noise=NoiseModel.of(noise, typical),
        around=scan.around,
        cost=float(np.mean(closest.signed_mm**2)),
        method="dissertation",
    )


def suppress_minima(
    points: FloatArray, surface: Surface, start: FloatArray, settings: DissertationSettings
) -> IcpResult:
    """Repeat ICP from random perturbations of the best pose and keep the best (dissertation, section 3.3.3).

    The text ends "until there is no additional improvement", the tables give a "maximum number of iterations within
    minima suppression": one run without improvement proves little, so the full number is always run.
    """
    s = settings
    rng = np.random.default_rng(s.seed)

    def run(from_pose: FloatArray, stage: str) -> IcpResult:
        return icp(
            points,
            surface,
            from_pose,
            max_iterations=s.max_iterations,
            tolerance_mm2=s.tolerance_mm2,
            accelerated=s.accelerated,
            stage=stage,
        )

    best = run(start, "icp")
    history = list(best.history)
    centre = points.mean(axis=0)
    for _ in range(s.suppression_runs):
        trial = run(best.model_from_scanner @ _perturbation(rng, s, centre), "minima suppression")
        history.extend(trial.history)
        if np.mean(trial.distances_mm**2) < np.mean(best.distances_mm**2):
            best = trial
    return IcpResult(best.model_from_scanner, best.distances_mm, best.converged, history)


def _perturbation(rng: np.random.Generator, s: DissertationSettings, centre: FloatArray) -> FloatArray:
    """Random motion of the data about its centroid: angle and length uniform up to their bounds."""
    axis, direction = rng.normal(size=3), rng.normal(size=3)
    angle = np.radians(rng.uniform(0.0, s.perturbation_deg))
    rotation = rotation_from_vector(axis / np.linalg.norm(axis) * angle)
    shift = direction / np.linalg.norm(direction) * rng.uniform(0.0, s.perturbation_mm)
    return pose(rotation, centre - rotation @ centre + shift)
