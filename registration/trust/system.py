"""Normal equations of the pose and of errors that have a shape of their own (``docs/registration.md``, eq. 15)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray, IntArray
from picoradar.registration.least_squares import plane_rows, weighted_squares
from picoradar.registration.refine import observed_information
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import transform
from picoradar.registration.settings import TrustSettings
from picoradar.registration.solution import Solution
from picoradar.registration.trust.budget import ErrorBudget, Seen, Socket, error_columns, mirror_axes
from picoradar.registration.trust.correlation import cells, excess_noise, shared_spread, shared_variance
from picoradar.registration.trust.covariance import inverse_information

MIN_TOLD = 1e-3
"""Least share of its information that an error keeps when the pose may follow it: with less it is a motion of the pose,
as the scale of a wedge is, and rounding tells the rest."""


@dataclass(frozen=True)
class Points:
    """The points that say something of the pose, about it.

    Attributes
    ----------
    at : (M,) array of int
        Which of the scan they are.
    used : (M,) array of bool
        Those taken for bone.
    seen : Seen
        Where and how they were seen.
    rows : (M, 6) array
    residual, sigma, observed : (M,) arrays
        Across the surface, mm; weights in the information observed, 1/mm^2.
    line : (M, 2) array of int or None
        Row and column in the raster.
    radius_mm : float
        Root mean square distance of the used ones from their centre.
    """

    at: IntArray
    used: BoolArray
    seen: Seen
    rows: FloatArray
    residual: FloatArray
    sigma: FloatArray
    observed: FloatArray
    line: IntArray | None
    radius_mm: float

    @classmethod
    def of(
        cls, scan: Scan, solution: Solution, used: BoolArray, sigma: FloatArray, sockets: Sequence[Socket]
    ) -> Points:
        """Those of a solution that count, or whose doubt does."""
        observed = solution.observed if solution.observed is not None else used / sigma**2
        on = np.flatnonzero((observed != 0.0) | used)
        centre = np.asarray(transform(solution.model_from_scanner, scan.points[used]).mean(axis=0), dtype=np.float64)
        seen = seen_by(scan, solution, on, centre, sockets)
        places, normals = seen.places, seen.normals
        return cls(
            at=on,
            used=used[on],
            seen=seen,
            rows=plane_rows(places, normals, centre),
            residual=solution.closest.signed_mm[on],
            sigma=sigma[on],
            observed=observed[on],
            line=None if scan.raster is None else scan.raster[on],
            radius_mm=float(np.sqrt(((places[used[on]] - centre) ** 2).sum(axis=1).mean())),
        )


def seen_by(scan: Scan, solution: Solution, at: IntArray, centre: FloatArray, sockets: Sequence[Socket]) -> Seen:
    """Where and how points `at` (M,) of a scan were seen."""
    pose = solution.model_from_scanner
    places = transform(pose, scan.points[at])
    return Seen(
        places=places,
        normals=solution.closest.normals[at],
        beams=scan.beams[at] @ pose[:3, :3].T,
        arms=places - transform(pose, scan.origin[None]),
        mirrors=mirror_axes(scan.beams, pose[:3, :3]),
        centre=centre,
        sockets=sockets,
    )


@dataclass(frozen=True)
class Shown:
    """An error that the points themselves show.

    Attributes
    ----------
    name : str
        As in :attr:`ErrorBudget.biases`.
    value, sd : float
        As the points show it, in the budget's units.
    motion : (6,) array
        Of the pose by it.
    """

    name: str
    value: float
    sd: float
    motion: FloatArray


@dataclass(frozen=True)
class Solved:
    """What the points and the budget say of the pose together.

    Attributes
    ----------
    random : (6, 6) array
        Covariance of the pose by what differs from point to point, line to line and patch to patch.
    biases : dict of name to (6,) array
        Motions by one standard deviation of each error of the budget, as much of it as the points do not show.
    motion : (6,) array
        What they show of these errors moves the pose by so much.
    told : dict of name to float
        What they show of them.
    """

    random: FloatArray
    biases: dict[str, FloatArray]
    motion: FloatArray
    told: dict[str, float]


@dataclass(frozen=True)
class System:
    """Normal equations of ``e + g x - q b``: motions x of the pose, and errors b.

    Attributes
    ----------
    names : tuple of K str
        Of the errors, as in :attr:`ErrorBudget.biases`.
    information : (6 + K, 6 + K) array
        Observed.
    noise : (6 + K, 6 + K) array
        Covariance of the score: what the residuals' noise, and what lines and patches share, pull at.
    score : (6 + K,) array
    radius_mm, free_mm : float
        Length that makes turns and shifts comparable; standard deviation of what nothing holds.
    """

    names: tuple[str, ...]
    information: FloatArray
    noise: FloatArray
    score: FloatArray
    radius_mm: float
    free_mm: float

    @classmethod
    def of(cls, points: Points, names: Sequence[str], budget: ErrorBudget, settings: TrustSettings) -> System:
        """Put it together from the points."""
        rows = np.concatenate([points.rows, -error_columns(points.seen, names)], axis=1)
        weight = points.used / points.sigma**2
        scale = np.array([points.radius_mm] * 3 + [1.0] * (3 + len(names))) / settings.free_mm
        known = weighted_squares(rows, weight) + np.diag(scale**2)  # what nothing holds still has an inverse
        observed = observed_information(rows, points.observed, known)
        noise = observed + _shared(points, rows, weight, budget, settings)
        score = rows.T @ (points.residual * weight)
        return cls(tuple(names), observed, noise, score, points.radius_mm, settings.free_mm)

    def solved(self, budgeted: Mapping[str, float], taken: Mapping[str, float]) -> Solved:
        """Pose and errors, with standard deviations of these beforehand; some was `taken` off the points already.

        Those are estimated which the points tell better than the budget; the others count in full.
        """
        places = {name: 6 + self.names.index(name) for name in budgeted}
        told = [name for name, sd in budgeted.items() if self._alone(places[name])[1] < sd]
        block = [*range(6), *(places[name] for name in told)]
        prior = np.array([0.0] * 6 + [budgeted[name] ** -2 for name in told])
        inverse = self._inverse(block, prior)
        already = np.array([0.0] * 6 + [taken.get(name, 0.0) for name in told])
        found = -(inverse @ (self.score[block] + prior * already))[6:]
        answer = inverse[:6] @ self.noise[np.ix_(block, block)] @ inverse[:, :6]
        biases = {name: inverse[:6] @ self.information[block, places[name]] * sd for name, sd in budgeted.items()}
        biases |= {name: -inverse[:6, 6 + k] / budgeted[name] for k, name in enumerate(told)}
        pose_alone = self._inverse(block[:6], prior[:6])
        motion = -pose_alone @ self.information[:6, block[6:]] @ found
        values = dict(zip(told, found.tolist(), strict=True))
        return Solved(np.asarray(answer, dtype=np.float64), biases, np.asarray(motion, dtype=np.float64), values)

    def shown(self, probed: Sequence[str], budgeted: Mapping[str, float], settings: TrustSettings) -> list[Shown]:
        """Errors that the points show beyond chance and beyond the budget, each alone beside the pose."""
        found = []
        for name in probed:
            place = 6 + self.names.index(name)
            value, sd = self._alone(place)
            if abs(value) > settings.shown_sds * float(np.hypot(sd, budgeted.get(name, 0.0))):
                motion = self._inverse(list(range(6)), np.zeros(6)) @ self.information[:6, place] * value
                found.append(Shown(name, value, sd, np.asarray(motion, dtype=np.float64)))
        return found

    def _alone(self, place: int) -> tuple[float, float]:
        """Estimate of one error, with nothing but the pose beside it, and its standard deviation."""
        inverse, pull = self._inverse(list(range(6)), np.zeros(6)), self.information[:6, place]
        stiffness = float(self.information[place, place] - pull @ inverse @ pull)
        answer, both = np.append(-inverse @ pull, 1.0), [*range(6), place]
        spread = float(answer @ self.noise[np.ix_(both, both)] @ answer)
        if stiffness <= MIN_TOLD * self.information[place, place] or spread <= 0.0:
            return 0.0, np.inf
        return -float(answer @ self.score[both]) / stiffness, float(np.sqrt(spread)) / stiffness

    def _inverse(self, block: list[int], prior: FloatArray) -> FloatArray:
        """Inverse of a part of the information, and of what was known before."""
        scale = np.array([1.0 / self.radius_mm] * 3 + [1.0] * 3 + [p**-0.5 for p in prior[6:]])
        return inverse_information(self.information[np.ix_(block, block)] + np.diag(prior), scale, self.free_mm)


def _shared(
    points: Points, rows: FloatArray, weight: FloatArray, budget: ErrorBudget, settings: TrustSettings
) -> FloatArray:
    """Covariance (6 + K, 6 + K) that the score has beyond that of independent points with their own noise."""
    used, chance = points.used, settings.beyond_chance_sds
    residual, pulls = points.residual[used], rows * points.observed[:, None]
    cosine = -np.einsum("ij,ij->i", points.seen.normals, points.seen.beams)
    excess = excess_noise(points.residual / points.sigma, cosine, used, settings) - 1.0
    total = weighted_squares(rows, weight * excess)
    given = cells(points.seen.places, budget.correlation_mm)
    total += budget.sigma_model_mm**2 * shared_spread(pulls, given)
    patch = cells(points.seen.places, settings.patch_mm)
    beyond = shared_variance(residual, patch[used], chance) - budget.sigma_model_mm**2
    if beyond > 0.0:
        total += beyond * shared_spread(pulls, patch)
    if points.line is not None:
        found = [(shared_variance(residual, line[used], chance, beside=True), line) for line in points.line.T]
        variance, line = max(found, key=lambda one: one[0])
        if variance > 0.0:
            total += variance * shared_spread(pulls, line)
    return np.asarray(total, dtype=np.float64)
