"""Candidates away from sockets, drawn into the sharp minima that the rounded fields of the search do not show."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.model import Surface
from picoradar.registration.refine import BeamFitter, annealed, outside_regions
from picoradar.registration.scan import NoiseModel, Scan
from picoradar.registration.se3 import small_motion, transform
from picoradar.registration.search import Candidate, Search
from picoradar.registration.settings import EdgeSettings


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
        Of a whole body, draw the quarter turns of the best in as well.
    """
    if candidates[0].view.is_socket:
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
        turned = [
            *search.quarter_turns(found[0]),
            *swapped_faces(thin, surface, found[0].model_from_scanner, settings.edges),
        ]
        found = search.joined(found, [drawn(replace(found[0], model_from_scanner=pose, hits=0)) for pose in turned])
    return found


def swapped_faces(scan: Scan, surface: Surface, pose: FloatArray, settings: EdgeSettings) -> list[FloatArray]:
    """Poses (4, 4) in which two flat faces that are seen change places.

    A face and a strip of its neighbour fit the neighbour and a strip of the face as well, whatever the angle between
    them: by a half turn about the line that halves it, which meets their edge opposite to the body's middle.
    """
    near = surface.closest(transform(pose, scan.points))
    rounded = np.rint(near.normals / settings.same_normal)
    _, groups, count = np.unique(rounded, axis=0, return_inverse=True, return_counts=True)
    groups = groups.ravel()  # NumPy 2.0 gives a column
    largest = np.argsort(-count, kind="stable")[: settings.swapped_faces]
    points = np.array([near.points[groups == k].mean(axis=0) for k in largest])
    normals = np.array([near.normals[groups == k].mean(axis=0) for k in largest])
    centroid, _ = surface.principal_frame
    found = []
    for pair in map(list, combinations(range(len(largest)), 2)):
        rows = normals[pair]
        if np.linalg.norm(np.cross(*rows)) < settings.parallel_sine:
            continue  # parallel faces have no edge
        offsets = np.einsum("ij,ij->i", rows, points[pair] - centroid)
        on_edge = centroid + np.linalg.pinv(rows) @ offsets
        axis = rows.sum(axis=0) / np.linalg.norm(rows.sum(axis=0))
        found.append(small_motion(np.concatenate([np.pi * axis, np.zeros(3)]), on_edge) @ pose)
    return found
