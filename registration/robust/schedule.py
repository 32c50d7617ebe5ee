"""The robust method: search, then an exact finish.

(1) The socket's centre from a consensus over spheres, (2) rotations from a low-discrepancy sequence, (3) races of
damped Gauss-Newton steps under a one-sided loss on distance fields, (4) distinct finishers polished with tissue decided
over neighbourhoods and ranked by likelihood, (5) symmetric steps on cast beams with the noise they show.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.model import Model
from picoradar.registration.refine import Final, ends_beside, exact_finish, outside_regions, walked
from picoradar.registration.scan import (
    INDEPENDENT_POINTS,
    NoiseModel,
    Scan,
    initial_noise,
)
from picoradar.registration.se3 import transform
from picoradar.registration.search import ANYWHERE, SAME_DEG, SAME_MM, Candidate, Cone, Search, difference
from picoradar.registration.solution import Rival, Solution

FINISHED, WITHIN = 3, 60.0
"""So many candidates are finished, if their log likelihoods are within this of the best; the likeliest is taken."""

WHOLE_FINISHED, WHOLE_WITHIN = 5, 200.0
"""The same on a whole body: a field rounds its edges, and parts twins that are equal when beams are cast."""

MAX_RIVALS = 5
"""Rivals reported at most."""


def register_robust(
    scan: Scan, model: Model, start: FloatArray | Cone | None, noise_mm: float | None, regions: FloatArray
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
    """
    sigma = initial_noise(scan, noise_mm)
    cone = start if isinstance(start, Cone) else ANYWHERE
    search = Search(scan, model, sigma, cone)
    known = noise_mm is not None or scan.noise_known
    if isinstance(start, np.ndarray):
        return _finished(search, search.about(start), regions, noise_known=known, sure=True)
    candidates = search.from_anywhere()
    return _finished(search, candidates, regions, noise_known=known, sure=search.sure(candidates))


def register_beside(scan: Scan, model: Model, solved: FloatArray, regions: FloatArray) -> Solution:
    """Register a scan beside a pose (4, 4) that was found with other points of it; regions as above."""
    search = Search(scan, model, initial_noise(scan, None))
    candidates = search.beside(solved)
    return _finished(search, candidates, regions, noise_known=scan.noise_known, sure=True, also=[solved])


def _finished(
    search: Search,
    candidates: list[Candidate],
    regions: FloatArray,
    *,
    noise_known: bool,
    sure: bool,
    also: Sequence[FloatArray] = (),
) -> Solution:
    """Finish the likeliest candidates, and poses (4, 4) `also`, on all points, and take the best."""
    scan = search.scan

    def finished(start: FloatArray, points: Scan) -> Final:
        allowed = outside_regions(transform(start, points.points), regions)
        noise = NoiseModel(search.sigma_mm)
        return exact_finish(points, search.model.surface, start, noise, points.around, allowed, noise_known=noise_known)

    chosen, others = _worth_a_finish(candidates, len(search.trials.thin))
    starts = [*(c.model_from_scanner for c in chosen), *also]
    if search.trials.thin is not scan:
        starts = [finished(s, search.trials.thin).model_from_scanner for s in starts]
    finals = [finished(s, scan) for s in starts]
    walk = walked(max(finals, key=lambda f: f.log_likelihood), scan, lambda pose: finished(pose, scan))
    final = max(walk, key=lambda f: f.log_likelihood)
    ends = [(f.model_from_scanner, f.log_likelihood) for f in (*finals, *walk[1:])]
    offset = finals[0].log_likelihood - candidates[0].log_likelihood
    ends += [(c.model_from_scanner, c.log_likelihood + offset) for c in others]
    best = final.model_from_scanner
    return Solution(
        model_from_scanner=final.model_from_scanner,
        closest=final.closest(scan, search.model.surface),
        inliers=final.inliers,
        history=final.history,
        rivals=rivals_of(best, ends, search.middle),
        noise=final.noise,
        around=scan.around,
        cost=-final.log_likelihood,
        method="robust",
        sure=sure,
        beside=ends_beside(final, walk, min(len(scan), INDEPENDENT_POINTS)),
    )


def _worth_a_finish(candidates: list[Candidate], points: int) -> tuple[list[Candidate], list[Candidate]]:
    """Candidates that are finished, the likeliest first, and the others.

    Those nearly as likely as the best on the fields of the search; and the one that most starts ended at, for fields
    can flatter a wrong pose by more than that.
    """
    most, within = (WHOLE_FINISHED, WHOLE_WITHIN) if candidates[0].view.whole else (FINISHED, WITHIN)
    least = candidates[0].log_likelihood - within / points
    favourite = max(candidates, key=lambda c: c.hits)
    chosen = [c for k, c in enumerate(candidates) if (k < most and c.log_likelihood >= least) or c is favourite]
    return chosen, [c for c in candidates if not any(c is other for other in chosen)]


def rivals_of(best: FloatArray, ends: list[tuple[FloatArray, float]], middle: FloatArray) -> list[Rival]:
    """Minima other than the best, the likeliest first, each once: from poses with their log likelihoods."""
    rivals: list[Rival] = []
    known = [best]
    for found, log_likelihood in sorted(ends, key=lambda e: -e[1]):
        apart = [difference(found, other, middle) for other in known]
        if all(turn >= SAME_DEG or shift >= SAME_MM for turn, shift in apart):
            known.append(found)
            rivals.append(Rival(found, -log_likelihood, *apart[0]))
    return rivals[:MAX_RIVALS]
