"""Candidates away from sockets, drawn into the sharp minima that the rounded fields of the search do not show."""

from __future__ import annotations

from dataclasses import replace

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.model import flat_faces
from picoradar.registration.refine import BeamFitter, annealed, outside_regions
from picoradar.registration.robust.corners import Corners
from picoradar.registration.scan import NoiseModel, Scan
from picoradar.registration.se3 import transform
from picoradar.registration.search import Candidate, Search, same_minimum


def drawn_in(search: Search, candidates: list[Candidate], regions: FloatArray, *, symmetric: bool) -> list[Candidate]:
    """Candidates with those that annealing leads to, all ranked by the beams that they would have cast [eq. 11, 13].

    A socket has a minimum as wide as its fossa. Elsewhere edges may hold the pose: the fields of the search round them,
    and a candidate may be the only one of its minimum and yet a few millimetres beside it.

    Parameters
    ----------
    search : Search
    candidates : list of Candidate
        The best first.
    regions : (K, 4) array
        Excluded spheres of the model, centre and radius.
    symmetric : bool
        Of a whole body, draw in the quarter turns of the best as well, and poses that bring corners together.
    """
    if not candidates[0].view.edges:
        return candidates
    settings, thin, surface = search.settings, search.descent.thin, search.model.surface
    noise = NoiseModel.of(search.sigma_mm, settings.noise)
    fitter = BeamFitter(thin, surface, noise, thin.around, noise_known=True, settings=settings)
    few = thin.thinned(settings.edges.drawn_points)

    def allowed(pose: FloatArray, points: Scan) -> BoolArray:
        return outside_regions(transform(pose, points.points), regions)

    def ranked(pose: FloatArray, candidate: Candidate) -> Candidate:
        likelihood = fitter.likelihood_at(pose, noise, allowed(pose, thin))
        return replace(candidate, model_from_scanner=pose, log_likelihood=likelihood)

    def drawn(candidate: Candidate) -> Candidate:
        pose = candidate.model_from_scanner
        return ranked(annealed(few, surface, pose, allowed(pose, few), settings), candidate)

    plain = [ranked(c.model_from_scanner, replace(c, hits=0)) for c in candidates]
    found = search.joined(plain, [drawn(c) for c in candidates])
    if symmetric and found[0].view.whole:
        turned = [replace(found[0], model_from_scanner=pose, hits=0) for pose in search.quarter_turns(found[0])]
        found = search.joined(found, [drawn(c) for c in turned])
        corners = Corners(thin, surface, flat_faces(surface, settings.edges), settings.edges)
        for _ in range(settings.edges.corner_rounds):
            best = found[0]
            found = search.joined(found, [drawn(c) for c in cornered(search, corners, found)])
            if found[0] is best:  # neither a likelier pose was met nor this one again: nothing has changed
                break
    return found


def cornered(search: Search, corners: Corners, found: list[Candidate]) -> list[Candidate]:
    """The best distinct poses that bring corners of faces together, from the likeliest of the candidates found."""
    edges = search.settings.edges
    ends = [
        (score, pose, candidate)
        for candidate in found[: edges.turned_poses]
        for score, pose in corners.turned(candidate.model_from_scanner)
    ]
    chosen: list[Candidate] = []
    for _, pose, origin in sorted(ends, key=lambda end: end[0]):
        known = (other.model_from_scanner for other in (origin, *chosen))
        if not any(same_minimum(pose, other, search.middle, search.settings.search) for other in known):
            chosen.append(replace(origin, model_from_scanner=pose, hits=0))
            if len(chosen) == edges.drawn_corners:
                break
    return chosen
