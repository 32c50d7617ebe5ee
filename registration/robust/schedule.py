"""The schedule of the robust method: from the minima of the search to the pose that the beams fit best.

Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.model import Closest, Model
from picoradar.registration.refine import (
    BeamFit,
    BeamFitter,
    alternatives_at,
    alternatives_of,
    beside_weak,
    edge_forgiving_likelihood,
    outside_regions,
    shallow_poses,
)
from picoradar.registration.robust.drawing import drawn_in
from picoradar.registration.scan import NoiseModel, Scan, initial_noise
from picoradar.registration.se3 import transform
from picoradar.registration.search import ANYWHERE, Candidate, Cone, Search, difference
from picoradar.registration.settings import RobustSettings
from picoradar.registration.solution import Rival, Solution


def register_robust(
    scan: Scan,
    model: Model,
    start: FloatArray | Cone | None,
    noise_mm: float | None,
    regions: FloatArray,
    settings: RobustSettings,
) -> Solution:
    """Register a scan to a model.

    Parameters
    ----------
    scan : Scan
    model : Model
    start : (4, 4) array, Cone or None
        None searches from anywhere.
    noise_mm : float or None
        Range noise; estimated when None.
    regions : (K, 4) array
        Excluded spheres of the model, centre and radius.
    settings : RobustSettings
    """
    sigma = initial_noise(scan, noise_mm, settings.noise)
    cone = start if isinstance(start, Cone) else ANYWHERE
    search = Search(scan, model, sigma, settings, cone)
    noise_known = noise_mm is not None or scan.noise_known
    if isinstance(start, np.ndarray):
        candidates = drawn_in(search, search.about(start), regions, symmetric=False)
        return _Fits.of(search, candidates, regions, noise_known=noise_known).solved(candidates, confident=True)
    candidates = drawn_in(search, search.from_anywhere(), regions, symmetric=True)
    fits = _Fits.of(search, candidates, regions, noise_known=noise_known)
    met = not fits.edges or candidates[0].hits > 0  # else a turn alone led there, and no start
    return fits.solved(candidates, confident=met and search.confident(candidates))


def register_near(
    scan: Scan, model: Model, solved: FloatArray, regions: FloatArray, settings: RobustSettings
) -> Solution:
    """Register a scan near a pose (4, 4) that was found with other points of it; regions as above."""
    search = Search(scan, model, initial_noise(scan, None, settings.noise), settings)
    candidates = search.near(solved)
    fits = _Fits.of(search, candidates, regions, noise_known=scan.noise_known)
    return fits.solved(candidates, confident=True, also=[solved])


@dataclass(frozen=True)
class _Fits:
    """Beam fits of what a search found; with `edges`, away from sockets, where sharp edges may hold the pose."""

    search: Search
    regions: FloatArray
    noise_known: bool
    edges: bool

    @classmethod
    def of(cls, search: Search, candidates: list[Candidate], regions: FloatArray, *, noise_known: bool) -> _Fits:
        """Fits of these candidates."""
        return cls(search, regions, noise_known, edges=candidates[0].view.edges)

    def solved(self, candidates: list[Candidate], *, confident: bool, also: Sequence[FloatArray] = ()) -> Solution:
        """Fit the likeliest candidates, and poses (4, 4) `also`, and take the best."""
        settings, scan, thin = self.search.settings, self.search.scan, self.search.descent.thin
        # 1. The candidates that may be the best when the beams are cast.
        chosen, others = worth_a_fit(candidates, len(thin), settings)
        starts = [*(c.model_from_scanner for c in chosen), *also]
        # 2. Of a large scan, first on some of its points.
        if thin is not scan:
            starts = [self.fitted(start, thin).model_from_scanner for start in starts]
        # 3. On all points [eq. 1 to 9].
        fits = [self.fitted(start, scan) for start in starts]
        if self.edges:  # what is nearly as likely beside the likeliest may lead to a likelier minimum [eq. 14]
            fits += [self.fitted(pose, scan) for pose, _ in self.shallow(max(fits, key=_log_likelihood))]
        # 4. Beside the likeliest, where its rotation is held weakly [eq. 12].
        likeliest = max(fits, key=_log_likelihood)
        walk = beside_weak(likeliest, scan, lambda pose: self.fitted(pose, scan), settings.weak_mode)
        # 5. The likeliest of all is the pose [eq. 11]; other minima are its rivals.
        best = max(walk, key=_log_likelihood)
        offset = fits[0].log_likelihood - candidates[0].log_likelihood  # of fits over distance fields
        ends = [(f.model_from_scanner, f.log_likelihood) for f in (*fits, *walk[1:])]
        ends += self.all_but_edges(fits, best)
        ends += [(c.model_from_scanner, c.log_likelihood + offset) for c in others]
        # 6. What the judgement needs to know.
        independent = min(len(scan), settings.tissue.independent_points)
        beside = walk if self.edges else [*(f for f in fits if not self.elsewhere(f, best)), *walk[1:]]
        alternatives = alternatives_of(best, beside, scan, independent, settings.weak_mode)
        if self.edges:
            alternatives += alternatives_at(self.shallow(best), independent, settings.edges.e_fold_nats)
        closest = best.closest(scan, self.search.model.surface)
        return Solution(
            model_from_scanner=best.model_from_scanner,
            closest=closest,
            inliers=best.inliers,
            history=best.history,
            rivals=rivals_of(best.model_from_scanner, ends, self.search.middle, settings),
            noise=best.noise,
            around=scan.around,
            cost=-best.log_likelihood,
            method="robust",
            confident=confident,
            alternatives=alternatives,
            edges=self.edges,
            beside_share=self.beside_share(best, closest),
            observed=best.observed,
        )

    def fitted(self, start: FloatArray, scan: Scan) -> BeamFit:
        """Beam fit of a scan, or of some of its points, from a pose (4, 4)."""
        settings, surface = self.search.settings, self.search.model.surface
        noise = NoiseModel.of(self.search.sigma_mm, settings.noise)
        allowed = outside_regions(transform(start, scan.points), self.regions)
        fitter = BeamFitter(scan, surface, noise, scan.around, self.noise_known, settings, self.edges)
        return fitter.fit(start, allowed)

    def shallow(self, fit: BeamFit) -> list[tuple[FloatArray, float]]:
        """Poses beside a fit that the beams hardly tell from it, with what their likelihoods lack [eq. 14]."""
        settings, thin = self.search.settings, self.search.descent.thin
        fitter = BeamFitter(thin, self.search.model.surface, fit.noise, thin.around, self.noise_known, settings)
        allowed = outside_regions(transform(fit.model_from_scanner, thin.points), self.regions)
        return shallow_poses(
            fit, self.search.scan, lambda pose: fitter.likelihood_at(pose, fit.noise, allowed), settings
        )

    def elsewhere(self, fit: BeamFit, best: BeamFit) -> bool:
        """Whether a fit lies on other bone than the best one: the same bone again is a rival to be named, no spread."""
        middle = self.search.middle
        extent = float(np.sqrt(np.mean(np.sum((self.search.scan.points - middle) ** 2, axis=1))))
        return difference(fit.model_from_scanner, best.model_from_scanner, middle)[1] > 2.0 * extent

    def all_but_edges(self, fits: list[BeamFit], best: BeamFit) -> list[tuple[FloatArray, float]]:
        """Poses of fits with log likelihoods that lack no more than what edges cannot have decided."""
        search = self.search
        if not (self.edges and search.model.closed):
            return []

        def forgiving(fit: BeamFit) -> float:
            allowed = outside_regions(transform(fit.model_from_scanner, search.scan.points), self.regions)
            return edge_forgiving_likelihood(fit, search.scan, search.model.surface, allowed, search.settings)

        offset = best.log_likelihood - forgiving(best)
        return [(fit.model_from_scanner, forgiving(fit) + offset) for fit in fits]

    def beside_share(self, fit: BeamFit, closest: Closest) -> float:
        """Share of the points just beside a closed model whose beams pass it by: nothing sends light back there."""
        if not (self.edges and self.search.model.closed):
            return 0.0
        near = np.abs(closest.signed_mm) < self.search.settings.edges.beside_mm
        return float(np.mean((fit.met.faces < 0) & near))


def _log_likelihood(fit: BeamFit) -> float:
    return fit.log_likelihood


def worth_a_fit(
    candidates: list[Candidate], points: int, settings: RobustSettings
) -> tuple[list[Candidate], list[Candidate]]:
    """Candidates that are fitted, the likeliest first, and the others.

    Those nearly as likely as the best on the fields of the search; and the one that most starts ended at, and the best
    of each other hollow, for fields can flatter a wrong pose by more than that.
    """
    max_fits, within_nats = settings.schedule.max_fits, settings.schedule.fit_within_nats
    if candidates[0].view.edges:
        max_fits, within_nats = settings.edges.max_fits, np.inf
    lowest = candidates[0].log_likelihood - within_nats / points
    most_met = max(candidates, key=lambda c: c.hits)
    of_hollows = list({id(c.view): c for c in reversed(candidates)}.values())
    chosen = [
        c
        for k, c in enumerate(candidates)
        if (k < max_fits and c.log_likelihood >= lowest) or c is most_met or any(c is one for one in of_hollows)
    ]
    return chosen, [c for c in candidates if not any(c is other for other in chosen)]


def rivals_of(
    best: FloatArray, ends: list[tuple[FloatArray, float]], middle: FloatArray, settings: RobustSettings
) -> list[Rival]:
    """Minima other than the best, the likeliest first, each once: from poses with their log likelihoods."""
    search = settings.search
    rivals: list[Rival] = []
    known = [best]
    for found, log_likelihood in sorted(ends, key=lambda e: -e[1]):
        apart = [difference(found, other, middle) for other in known]
        if all(turn >= search.same_deg or shift >= search.same_mm for turn, shift in apart):
            known.append(found)
            rivals.append(Rival(found, -log_likelihood, *apart[0]))
    return rivals[: settings.schedule.max_rivals]
