"""`Tracker`: a pose that is known, refined with the points so far; and its rivals, watched one after the other.

The beam fit is that of a batch registration, begun at the last pose, where it settles within a cast. What a search
found out (rivals, whether the pose was met often) is kept until the next one. Equation numbers are those of
``docs/registration.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.model import Model
from picoradar.registration.refine import (
    BeamFit,
    BeamFitter,
    CastBeams,
    alternatives_of,
    beside_weak,
    outside_regions,
)
from picoradar.registration.robust import register_robust, relative_brightness, without_dark_points
from picoradar.registration.scan import Scan, weighted_by_response
from picoradar.registration.search import Cone, difference, same_minimum
from picoradar.registration.settings import LiveSettings, RobustSettings
from picoradar.registration.solution import Rival, Solution


@dataclass(frozen=True)
class Tracker:
    """Solves growing scans of one model.

    Attributes
    ----------
    model : Model
    start : (4, 4) array, Cone or None
        Where a search begins; None is anywhere.
    noise_mm : float or None
        Range noise where it is known.
    regions : (K, 4) array
        Excluded spheres of the model, centre and radius.
    settings : RobustSettings
    live : LiveSettings
    """

    model: Model
    start: FloatArray | Cone | None
    noise_mm: float | None
    regions: FloatArray
    settings: RobustSettings
    live: LiveSettings

    def weighted(self, scan: Scan) -> Scan:
        """The scan with its points weighted as in a batch registration."""
        if scan.covariance is None and scan.response_mv is not None:
            return weighted_by_response(scan, self.noise_mm, self.settings.noise)
        return scan

    def searched(self, scan: Scan) -> Solution:
        """Solve a weighted scan as a batch registration does.

        Raises
        ------
        RegistrationError
        """
        found = register_robust(scan, self.model, self.start, self.noise_mm, self.regions, self.settings)
        return without_dark_points(scan, self.model, found, self.regions, self.settings)

    def followed(self, scan: Scan, before: Solution, bright: BoolArray, *, walk: bool) -> Solution:
        """Solve a weighted scan from the solution of its first lines.

        Parameters
        ----------
        scan : Scan
        before : Solution
        bright : (N,) array of bool
            Points that were not found darker than bone so far.
        walk : bool
            Look beside the pose, too [eq. 12]; else the alternatives of the last walk stay.
        """

        def fitted(pose: FloatArray) -> BeamFit:
            return self._fitted(scan, pose, before, allowed)

        allowed = bright & self._allowed(scan, before.model_from_scanner)
        fit = fitted(before.model_from_scanner)
        if not walk:
            return self._solution(scan, fit, before)
        ends = beside_weak(fit, scan, fitted, self.settings.weak_mode)
        best = max(ends, key=lambda end: end.log_likelihood)
        independent = min(len(scan), self.settings.tissue.independent_points)
        alternatives = before.alternatives if before.edges else []
        alternatives = [*alternatives, *alternatives_of(best, ends, scan, independent, self.settings.weak_mode)]
        return replace(self._solution(scan, best, before), alternatives=alternatives)

    def same(self, one: Solution, other: Solution, scan: Scan) -> bool:
        """Whether two solutions of a scan are one minimum."""
        middle = np.asarray(scan.points.mean(axis=0), dtype=np.float64)
        return same_minimum(one.model_from_scanner, other.model_from_scanner, middle, self.settings.search)

    def explained(self, scan: Scan, solution: Solution) -> float:
        """Share of a scan's points that lie on the model at the pose of a solution, as it is."""
        pose, beam_fit = solution.model_from_scanner, self.settings.beam_fit
        allowed = self._allowed(scan, pose)
        beams = CastBeams.at(scan, self.model.surface, pose, allowed, beam_fit, self.settings.tissue)
        sigma = solution.noise.plane_sigma(scan, pose[:3, :3], beams.normals)
        return float(beams.bone(beams.signed_mm, sigma, scan.around)[1].mean())

    def bright(self, scan: Scan, solution: Solution) -> BoolArray:
        """Points (N,) that are as bright as bone; all of them where amplitudes tell nothing."""
        s, on = self.settings.brightness, solution.inliers
        every = np.ones(len(scan), dtype=np.bool_)
        if scan.response_mv is None or on.mean() < self.settings.trust.min_inlier_share:
            return every
        if np.median(scan.response_mv[on]) <= 0.0:
            return every
        bright = np.asarray(relative_brightness(scan, scan.response_mv, solution, s) > s.min_share)
        return every if bright[on].mean() < s.min_bright_inliers else bright

    def watched(self, scan: Scan, solution: Solution, turn: int) -> Solution:
        """The solution with one of its rivals, taken in turn, compared with it anew on some of the points."""
        rivals = [r for r in solution.rivals if self._plausible(r, solution, len(scan))]
        if not rivals:
            return solution
        thin = scan.thinned(self.live.watched_points)
        rival = rivals[turn % len(rivals)]
        allowed = self._allowed(thin, rival.model_from_scanner)
        other = self._fitted(thin, rival.model_from_scanner, solution, allowed)
        here = self._fitted(thin, solution.model_from_scanner, solution, allowed)
        others = [r for r in solution.rivals if r is not rival]
        pose, middle = solution.model_from_scanner, np.asarray(thin.points.mean(axis=0), dtype=np.float64)
        if same_minimum(pose, other.model_from_scanner, middle, self.settings.search):
            return replace(solution, rivals=others)  # with more points both are one
        cost = solution.cost + here.log_likelihood - other.log_likelihood
        apart = difference(other.model_from_scanner, pose, middle)
        seen = Rival(other.model_from_scanner, cost, *apart)
        return replace(solution, rivals=sorted([*others, seen], key=lambda r: r.cost))

    def _plausible(self, rival: Rival, solution: Solution, points: int) -> bool:
        independent = min(points, self.settings.tissue.independent_points)
        return (rival.cost - solution.cost) * independent < self.live.watched_nats

    def _fitted(self, scan: Scan, pose: FloatArray, before: Solution, allowed: BoolArray) -> BeamFit:
        known = self.noise_mm is not None or scan.noise_known
        steps = replace(self.settings.beam_fit, max_casts=self.live.casts)
        settings = replace(self.settings, beam_fit=steps)
        fitter = BeamFitter(scan, self.model.surface, before.noise, scan.around, known, settings, before.edges)
        return fitter.fit(pose, allowed)

    def _allowed(self, scan: Scan, pose: FloatArray) -> BoolArray:
        return outside_regions(scan.points @ pose[:3, :3].T + pose[:3, 3], self.regions)

    def _solution(self, scan: Scan, fit: BeamFit, before: Solution) -> Solution:
        """A solution of a fit; what only a search can tell is that of the search before."""
        change = before.cost + fit.log_likelihood
        return replace(
            before,
            model_from_scanner=fit.model_from_scanner,
            closest=fit.closest(scan, self.model.surface),
            inliers=fit.inliers,
            history=fit.history,
            rivals=[replace(rival, cost=rival.cost - change) for rival in before.rivals],
            noise=fit.noise,
            around=scan.around,
            cost=-fit.log_likelihood,
            observed=fit.observed,
        )
