"""The robust method: a global race of starts, neighbourhood-aware polishing of the best, and an exact finish.

Order of the figures: (1) the socket's centre from a consensus over spheres, (2) rotations from a low-discrepancy
sequence, (3) a race of damped Gauss-Newton steps under a one-sided loss on distance fields, (4) distinct finishers
polished with tissue decided over neighbourhoods and ranked by likelihood, (5) exact closest points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from registration._types import BoolArray, FloatArray, IntArray
from registration.assess import Solution
from registration.batch import Poses
from registration.centres import sphere_centres
from registration.errors import StartError
from registration.exclusion import outside_regions
from registration.model import Model
from registration.noise import TYPICAL_RANGE_MM, NoiseModel
from registration.polish import exact_finish, polish
from registration.race import Cloud, distinct, race, shuffle, telling_order
from registration.result import Rival
from registration.rigid import inverse, pose, rotation_angle_deg, transform
from registration.scan import Scan
from registration.seeds import rotations_in_cone, rotations_near
from registration.surface import Closest
from registration.tissue import neighbours, raster_noise
from registration.views import SHELL_CONE_DEG, View, start_view

STARTS = 512
"""Rotations that enter one race from any pose."""

MAX_RACES = 4
"""Races run at most while the best minimum is not sure."""

SURE_HITS = 3
"""A minimum that so many finishers reach is sure."""

NOISE_LIMIT = 3.0
"""How many times the expected noise the points may scatter before the pose is doubted."""

STARTS_NEAR = 192
"""Rotations that enter it about a given start."""

START_CONE_DEG = 25.0
"""How far clicked landmarks may be off."""

POLISHED_POINTS = 1500
"""Candidates are polished on at most so many points; all take part in the exact finish."""


@dataclass(frozen=True)
class Candidate:
    """A distinct minimum.

    Attributes
    ----------
    model_from_scanner : (4, 4) array
    log_likelihood : float
        Mean a point; the larger the better.
    hits : int
        Finishers of the race that ended here.
    """

    model_from_scanner: FloatArray
    log_likelihood: float
    hits: int = 1


def candidates_from_any(scan: Scan, model: Model, sigma_mm: float, draw: int = 0) -> list[Candidate]:
    """Search all views of a model from any pose; distinct minima, best first.

    Parameters
    ----------
    scan : Scan
    model : Model
    sigma_mm : float
        Noise along the beam.
    draw : int
        Number of the race: each draws other starts and other points.
    """
    found: list[Candidate] = []
    towards = _unit(-scan.beams.mean(axis=0))
    for view in model.views:
        centres = sphere_centres(scan.points, towards, view.radius_mm)
        if not centres:
            continue
        rotations = rotations_in_cone(view.axis, towards, SHELL_CONE_DEG + 5.0, STARTS, draw * STARTS)
        offsets = np.array(centres)[np.arange(STARTS) % len(centres)] - centres[0]
        shifts = -(rotations @ offsets[..., None])[..., 0]
        order = telling_order(scan.points, centres[0], view.radius_mm, draw)
        found.extend(_searched(scan, view, centres[0], order, rotations, shifts, sigma_mm))
    return sorted(found, key=lambda c: -c.log_likelihood)


def candidates_near(scan: Scan, model: Model, start: FloatArray, sigma_mm: float) -> list[Candidate]:
    """Search the neighbourhood of a start pose."""
    view = _view_at(scan, model, start)
    centre = transform(inverse(start), view.centre[None])[0]
    rotations = rotations_near(start[:3, :3], START_CONE_DEG, STARTS_NEAR)
    return _searched(scan, view, centre, shuffle(len(scan)), rotations, np.zeros((STARTS_NEAR, 3)), sigma_mm)


def _view_at(scan: Scan, model: Model, start: FloatArray) -> View:
    """The prepared view that a start looks into, or one made for it."""
    aimed = transform(start, scan.points)
    middle = aimed.mean(axis=0)
    towards = _unit(transform(start, scan.origin[None])[0] - middle)
    for view in model.views:
        near = np.linalg.norm(aimed - view.centre, axis=1) < 1.5 * view.radius_mm
        if near.mean() > 0.8 and towards @ view.axis > np.cos(np.radians(SHELL_CONE_DEG)):
            return view
    reach = float(np.linalg.norm(aimed - middle, axis=1).max()) + 15.0
    return start_view(model.surface, middle, towards, reach)


def _searched(
    scan: Scan,
    view: View,
    centre: FloatArray,
    order: IntArray,
    rotations: FloatArray,
    shifts: FloatArray,
    sigma_mm: float,
) -> list[Candidate]:
    cloud = Cloud.about(scan.points, scan.beams, centre, order)
    starts = Poses(rotations.astype(np.float32), shifts.astype(np.float32))
    finishers, _ = race(view, cloud, starts, stretch=max(1.0, sigma_mm / TYPICAL_RANGE_MM))
    first, hits = distinct(finishers)
    chosen = np.sort(shuffle(len(scan))[:POLISHED_POINTS])
    grid = None if scan.grid is None or len(chosen) < len(scan) else scan.grid
    thin = Scan(scan.points[chosen], scan.beams[chosen], scan.origin, grid=grid)
    points = np.ascontiguousarray((thin.points - centre).T, dtype=np.float32)
    beams = np.ascontiguousarray(thin.beams.T, dtype=np.float32)
    polished, likelihood = polish(view.fine, finishers.at(first), points, beams, neighbours(thin), sigma_mm)
    best = np.argsort(-likelihood, kind="stable")
    apart, _ = distinct(polished.at(best))
    best = best[apart]
    rotation = polished.rotations[best].astype(np.float64)
    translation = view.centre + polished.shifts[best] - (rotation @ centre)
    poses = pose(rotation, translation)
    return [Candidate(p, float(v), int(h)) for p, v, h in zip(poses, likelihood[best], hits[best], strict=True)]


def search(scan: Scan, model: Model, start: FloatArray | None, sigma_mm: float) -> list[Candidate]:
    """Distinct minima, best first: about a start, or from anywhere.

    From anywhere, races are run until one minimum has drawn several finishers or wins twice.

    Raises
    ------
    StartError
        If there is no start and the model has no hollow region to search.
    """
    if start is not None:
        return candidates_near(scan, model, start, sigma_mm)
    if not model.views:
        raise StartError(
            "the model has no hollow, socket-like region to search from anywhere: give landmarks or a pose"
        )
    found: list[Candidate] = []
    for draw in range(MAX_RACES):
        found = merged(found, candidates_from_any(scan, model, sigma_mm, draw), scan.points.mean(axis=0))
        if not found or found[0].hits >= SURE_HITS:
            break
    return found


def merged(one: list[Candidate], other: list[Candidate], at: FloatArray) -> list[Candidate]:
    """Join two lists of minima; the same minimum found twice counts its hits together, twice over."""
    out: list[Candidate] = []
    for candidate in sorted([*one, *other], key=lambda c: -c.log_likelihood):
        for index, better in enumerate(out):
            turn, shift = difference(better.model_from_scanner, candidate.model_from_scanner, at)
            if turn < 2.0 and shift < 1.0:
                out[index] = replace(better, hits=better.hits + SURE_HITS)
                break
        else:
            out.append(candidate)
    return out


def register_robust(
    scan: Scan, model: Model, start: FloatArray | None, noise_mm: float | None, regions: FloatArray
) -> Solution:
    """Register by search, polish and exact finish.

    Parameters
    ----------
    scan : Scan
    model : Model
    start : (4, 4) array or None
    noise_mm : float or None
        Range noise; estimated when None.
    regions : (K, 4) array
        Excluded spheres of the model, centre and radius.
    """
    around = neighbours(scan)
    sigma = initial_noise(scan, around, noise_mm)
    candidates = search(scan, model, start, sigma)
    if not candidates:
        raise StartError("no sphere of the model's socket fits the points: give landmarks or a pose to start from")
    best = candidates[0].model_from_scanner
    allowed = outside_regions(transform(best, scan.points), regions)
    noise = NoiseModel(range_mm=sigma)
    final = exact_finish(scan, model.surface, best, noise, around, allowed)
    if noise_mm is None and scan.covariance is None and final.inliers.sum() >= 20:
        noise = estimated_noise(scan, final.model_from_scanner, final.closest, final.inliers)
        again = exact_finish(scan, model.surface, final.model_from_scanner, noise, around, allowed)
        final = replace(again, history=final.history + again.history)
    middle = scan.points.mean(axis=0)
    return Solution(
        model_from_scanner=final.model_from_scanner,
        closest=final.closest,
        inliers=final.inliers,
        history=final.history,
        rivals=[
            Rival(c.model_from_scanner, -c.log_likelihood, *difference(c.model_from_scanner, best, middle))
            for c in candidates[1:6]
        ],
        noise=noise,
        noise_limit_mm=NOISE_LIMIT * (noise_mm or TYPICAL_RANGE_MM),
        cost=-candidates[0].log_likelihood,
        method="robust",
    )


def estimated_noise(scan: Scan, solution: FloatArray, closest: Closest, used: BoolArray) -> NoiseModel:
    """Range noise from the residuals of the points in use, projected back onto their beams (MAD scale)."""
    beams = scan.beams[used] @ solution[:3, :3].T
    cosine = np.abs(np.einsum("ij,ij->i", beams, closest.normals[used]))
    steep = cosine > 0.5
    if steep.sum() < 6:
        return NoiseModel()
    along = closest.signed_mm[used][steep] / cosine[steep]
    return NoiseModel(range_mm=float(np.clip(1.4826 * np.median(np.abs(along)), 0.02, 5.0)))


def initial_noise(scan: Scan, around: IntArray, noise_mm: float | None) -> float:
    """Noise along the beam to search with: given, from the covariances, or from the raster itself."""
    if noise_mm is not None:
        return noise_mm
    if scan.covariance is not None:
        return float(np.sqrt(np.median(np.einsum("ni,nij,nj->n", scan.beams, scan.covariance, scan.beams))))
    found = raster_noise(scan, around)
    return float(np.clip(0.65 * found, 0.1, 2.0)) if np.isfinite(found) else TYPICAL_RANGE_MM


def difference(one: FloatArray, other: FloatArray, at: FloatArray) -> tuple[float, float]:
    """Rotation in degrees between two poses, and the shift in mm of the scanner-frame point `at`."""
    shift = transform(one, at[None])[0] - transform(other, at[None])[0]
    return rotation_angle_deg(one[:3, :3] @ other[:3, :3].T), float(np.linalg.norm(shift))


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
