"""Finds the hollow, nearly spherical regions of a model: the places that a scan of a joint socket can come from.

A point of a hollow sphere votes for the centre ``v + R n``; true centres collect the votes of a whole patch (a Hough
transform over centre and radius), and a robust fit then settles centre, radius and opening direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray, IntArray
from picoradar.registration.model.centres import soft_count
from picoradar.registration.model.surface import Surface

RADII_MM = np.arange(14.0, 37.0, 1.5)
"""Radii of joint sockets that are looked for."""

CELL_MM = 3.0
"""Cell of the vote count."""

HYPOTHESES = 400
"""Spheres tried about each peak."""

MAX_FACES = 10_000
"""Of larger models so many faces, evenly taken, are asked."""

MIN_FACES = 30
"""Fewer faces on a sphere are chance."""


@dataclass(frozen=True)
class Socket:
    """A hollow region.

    Attributes
    ----------
    centre : (3,) array
        Of the fitted sphere, mm.
    radius_mm : float
    axis : (3,) array
        Unit vector from the centre through the opening.
    area_mm2 : float
        Area of the model that lies on the sphere.
    """

    centre: FloatArray
    radius_mm: float
    axis: FloatArray
    area_mm2: float


def find_sockets(surface: Surface, *, limit: int = 3, smallest_share: float = 0.5) -> list[Socket]:
    """Return the hollow spherical regions of a surface, largest first.

    Parameters
    ----------
    surface : Surface
    limit : int
        At most so many.
    smallest_share : float
        Regions with less than this share of the largest one's area are left out.
    """
    stride = max(1, len(surface.faces) // MAX_FACES)
    centres = surface.vertices[surface.faces[::stride]].mean(axis=1)
    normals, areas = surface.face_normals[::stride], surface.face_areas[::stride] * stride
    found: list[Socket] = []
    fitted = [_fitted(centres, normals, areas, *peak) for peak in _peaks(centres, normals, areas, 4 * limit)]
    for socket in sorted((s for s in fitted if s is not None), key=lambda s: -s.area_mm2):
        apart = all(np.linalg.norm(socket.centre - s.centre) > 0.5 * s.radius_mm for s in found)
        if apart and socket.area_mm2 >= smallest_share * (found or [socket])[0].area_mm2:
            found.append(socket)
    return found[:limit]


def _peaks(points: FloatArray, normals: FloatArray, areas: FloatArray, count: int) -> list[tuple[FloatArray, float]]:
    low = points.min(axis=0) - RADII_MM[-1]
    shape = np.ceil((points.max(axis=0) + RADII_MM[-1] - low) / CELL_MM).astype(np.int64) + 1
    peaks: list[tuple[float, FloatArray, float]] = []
    for radius in RADII_MM:
        cell = ((points + radius * normals - low) / CELL_MM).astype(np.int64)
        flat = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
        votes = np.bincount(flat, weights=areas, minlength=int(shape.prod()))
        most = np.argpartition(-votes, 4)[:4]
        for place in most[np.argsort(-votes[most], kind="stable")]:
            where = np.array(np.unravel_index(int(place), tuple(shape)), dtype=np.float64)
            peaks.append((float(votes[place] / radius**2), low + (where + 0.5) * CELL_MM, float(radius)))
    chosen: list[tuple[FloatArray, float]] = []
    for _, centre, radius in sorted(peaks, key=lambda p: -p[0]):
        if all(np.linalg.norm(centre - other) > 2.0 * CELL_MM for other, _ in chosen):
            chosen.append((centre, radius))
    return chosen[:count]


def _fitted(
    points: FloatArray, normals: FloatArray, areas: FloatArray, centre: FloatArray, radius: float
) -> Socket | None:
    """Settle on the largest sphere about a peak: hypotheses from pairs of points, then least squares on its points."""
    rng = np.random.default_rng(0)
    near = np.flatnonzero(_on_sphere(points, normals, centre, radius, 5.0, 0.7))
    if len(near) < MIN_FACES:
        return None
    first, second = rng.choice(near, (2, HYPOTHESES), p=areas[near] / areas[near].sum())
    centres, radii = _spheres_of_pairs(points, normals, first, second)
    valid = (np.linalg.norm(centres - centre, axis=1) < 8.0) & (np.abs(radii - radius) < 8.0)
    judged = rng.choice(near, 1000, p=areas[near] / areas[near].sum())
    if not valid.any():
        return None
    support = soft_count(centres[valid] - centre, radii[valid], points[judged] - centre, 0.7)
    chosen = int(np.argmax(support))
    centre, radius = centres[valid][chosen], float(radii[valid][chosen])
    on = np.zeros(len(points), dtype=np.bool_)
    for _ in range(5):
        on = _on_sphere(points, normals, centre, radius, 1.0, 0.85)
        if on.sum() < MIN_FACES:
            return None
        weight = np.sqrt(areas[on])[:, None]
        rows = np.column_stack([2.0 * points[on], np.ones(int(on.sum()))])
        x = np.linalg.lstsq(rows * weight, (points[on] ** 2).sum(axis=1) * weight[:, 0], rcond=None)[0]
        centre = x[:3]
        radius = float(np.sqrt(max(x[3] + centre @ centre, 1e-9)))
    if not RADII_MM[0] * 0.8 < radius < RADII_MM[-1] * 1.2:
        return None
    inward = centre - points[on]
    axis = (inward * areas[on, None]).sum(axis=0)
    return Socket(centre=centre, radius_mm=radius, axis=axis / np.linalg.norm(axis), area_mm2=float(areas[on].sum()))


def _spheres_of_pairs(
    points: FloatArray, normals: FloatArray, first: IntArray, second: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Spheres (K,) through pairs of points, centred where their normals pass each other most closely."""
    n1, n2, between = normals[first], normals[second], points[second] - points[first]
    cosine = np.einsum("ij,ij->i", n1, n2)
    along1, along2 = np.einsum("ij,ij->i", between, n1), np.einsum("ij,ij->i", between, n2)
    sine2 = np.maximum(1.0 - cosine**2, 1e-3)
    s1, s2 = (along1 - cosine * along2) / sine2, (cosine * along1 - along2) / sine2
    centres = (points[first] + s1[:, None] * n1 + points[second] + s2[:, None] * n2) / 2.0
    radii = (s1 + s2) / 2.0
    bad = np.abs(s1 - s2) > 3.0
    radii[bad] = np.inf
    return centres, radii


def _on_sphere(
    points: FloatArray, normals: FloatArray, centre: FloatArray, radius: float, width: float, cosine: float
) -> BoolArray:
    """Faces within `width` of a sphere whose normals point to its centre within the angle of `cosine`."""
    inward = centre - points
    distance = np.linalg.norm(inward, axis=1)
    towards = np.einsum("ij,ij->i", inward, normals) > cosine * distance
    return np.asarray((np.abs(distance - radius) < width) & towards)
