"""The pose's covariance and its biases, measured: information observed, what points share, and the error budget.

Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.refine import dispersion
from picoradar.registration.scan import MIN_POINTS, Scan
from picoradar.registration.settings import TrustSettings
from picoradar.registration.solution import Solution
from picoradar.registration.trust.budget import ErrorBudget, Socket, error_columns
from picoradar.registration.trust.covariance import patch_misfit_mm
from picoradar.registration.trust.system import Points, Shown, System, seen_by

MIN_COSINE = 0.25
"""Smallest cosine of incidence by which a shift across the surface is turned into one along the beam."""

PROBED = ("walk", "mirror scale", "model offset", "model scale")
"""Errors with a shape of their own, which the points may show whether or not the budget holds them."""


@dataclass(frozen=True)
class Known:
    """What is known beside the points.

    Attributes
    ----------
    budget : ErrorBudget
    sockets : sequence of Socket
        Of the model.
    taken : mapping of name to float
        Errors of the budget that were taken off the points already.
    """

    budget: ErrorBudget
    sockets: Sequence[Socket] = ()
    taken: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Assessed:
    """A solution's covariance [eq. 10] with what it is made of.

    Attributes
    ----------
    points : Points
    used : (N,) array of bool
        The inliers; all points where these are too few for a pose.
    sigma : (N,) array
    misfit_mm : float
    own : (6, 6) array
        Covariance of the pose about its own minimum.
    covariance : (6, 6) array
        With the spread of the alternatives.
    biases : dict of name to (6,) array
        Motions by one standard deviation of each error of the budget, as much of it as the points do not show [eq. 15].
    motion : (6,) array
        What they show of the budget's errors moves the pose by so much.
    told : dict of name to float
        What they show of them, beyond what was taken off them already.
    shown : list of Shown
        Errors that the budget does not explain.
    """

    points: Points
    used: BoolArray
    sigma: FloatArray
    misfit_mm: float
    own: FloatArray
    covariance: FloatArray
    biases: dict[str, FloatArray]
    motion: FloatArray
    told: dict[str, float]
    shown: list[Shown]

    @property
    def centre(self) -> FloatArray:
        """Centre (3,) of the points taken for bone: what small motions turn about."""
        return self.points.seen.centre

    @classmethod
    def of(cls, scan: Scan, solution: Solution, known: Known, settings: TrustSettings) -> Assessed:
        """Reckon it from the residuals, what is known beforehand, and the alternatives."""
        budget = known.budget
        enough = int(solution.inliers.sum()) >= MIN_POINTS
        used = solution.inliers if enough else np.ones(len(scan), dtype=np.bool_)
        sigma = solution.noise.plane_sigma(scan, solution.model_from_scanner[:3, :3], solution.closest.normals)
        points = Points.of(scan, solution, used, sigma, known.sockets)
        declared = {name: sd for name, sd in budget.biases.items() if sd > 0.0}
        system = System.of(points, [*declared, *(name for name in PROBED if name not in declared)], budget, settings)
        solved = system.solved(declared, known.taken)
        alternatives = dispersion(solution.model_from_scanner, solution.alternatives, points.seen.centre)
        return cls(
            points=points,
            used=used,
            sigma=sigma,
            misfit_mm=patch_misfit_mm(solution.closest.signed_mm, used, solution.around, settings.patch_min_neighbours),
            own=solved.random,
            covariance=solved.random + alternatives,
            biases=solved.biases,
            motion=solved.motion,
            told=solved.told,
            shown=system.shown(PROBED, declared, settings),
        )


def taken_off(
    scan: Scan, solution: Solution, fit: Assessed, known: Known, settings: TrustSettings
) -> tuple[FloatArray, dict[str, float]] | None:
    """Lengths (N,) along the beams that the points have to move by, and the errors taken off with them by then.

    None where the points show no more of the budget's errors than matters.
    """
    if not fit.told or solution.edges:
        return None
    everywhere = np.arange(len(scan))
    seen = seen_by(scan, solution, everywhere, fit.centre, known.sockets)
    change = error_columns(seen, list(fit.told)) @ np.array(list(fit.told.values()))
    if float(np.sqrt(np.mean(change[fit.used] ** 2))) < settings.refit_mm:
        return None
    along = np.einsum("ij,ij->i", seen.normals, seen.beams)
    total = {name: known.taken.get(name, 0.0) + value for name, value in fit.told.items()}
    return -change / np.minimum(along, -MIN_COSINE), {**known.taken, **total}
