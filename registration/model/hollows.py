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
from picoradar.registration.settings import HollowSettings

SMALLEST_SINE2, SMALLEST_SQUARE_MM2 = 1e-3, 1e-9
"""Floors of what is divided by or rooted: parallel normals meet nowhere, and a squared radius is positive."""


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


def find_sockets(surface: Surface, settings: HollowSettings) -> list[Socket]:
    """Return the hollow spherical regions of a surface, largest first."""
    stride = max(1, len(surface.faces) // settings.max_faces)
    faces = _Faces(
        surface.vertices[surface.faces[::stride]].mean(axis=1),
        surface.face_normals[::stride],
        surface.face_areas[::stride] * stride,
    )
    found: list[Socket] = []
    fitted = [_fitted(faces, *peak, settings) for peak in _peaks(faces, settings)]
    for socket in sorted((s for s in fitted if s is not None), key=lambda s: -s.area_mm2):
        apart = all(np.linalg.norm(socket.centre - s.centre) > settings.apart_radii * s.radius_mm for s in found)
        if apart and socket.area_mm2 >= settings.min_area_share * (found or [socket])[0].area_mm2:
            found.append(socket)
    return found[: settings.max_hollows]


@dataclass(frozen=True)
class _Faces:
    """Middles (F, 3) mm, unit normals (F, 3) and areas (F,) mm^2 of the faces that vote."""

    middles: FloatArray
    normals: FloatArray
    areas: FloatArray

    def on_sphere(self, centre: FloatArray, radius: float, width_mm: float, min_cosine: float) -> BoolArray:
        """Faces within a width of a sphere whose normals point to its centre within the angle of a cosine."""
        inward = centre - self.middles
        distance = np.linalg.norm(inward, axis=1)
        towards = np.einsum("ij,ij->i", inward, self.normals) > min_cosine * distance
        return np.asarray((np.abs(distance - radius) < width_mm) & towards)


def _peaks(faces: _Faces, settings: HollowSettings) -> list[tuple[FloatArray, float]]:
    """Centres (3,) and radii with the most votes."""
    cell_mm, taken = settings.cell_mm, settings.peaks_per_radius
    radii_mm = np.arange(
        settings.min_radius_mm, settings.max_radius_mm + settings.radius_step_mm / 2.0, settings.radius_step_mm
    )
    low = faces.middles.min(axis=0) - radii_mm[-1]
    shape = np.ceil((faces.middles.max(axis=0) + radii_mm[-1] - low) / cell_mm).astype(np.int64) + 1
    peaks: list[tuple[float, FloatArray, float]] = []
    for radius in radii_mm:
        cell = ((faces.middles + radius * faces.normals - low) / cell_mm).astype(np.int64)
        flat = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
        votes = np.bincount(flat, weights=faces.areas, minlength=int(shape.prod()))
        fullest = np.argpartition(-votes, taken)[:taken]
        for place in fullest[np.argsort(-votes[fullest], kind="stable")]:
            where = np.array(np.unravel_index(int(place), tuple(shape)), dtype=np.float64)
            peaks.append((float(votes[place] / radius**2), low + (where + 0.5) * cell_mm, float(radius)))
    chosen: list[tuple[FloatArray, float]] = []
    for _, centre, radius in sorted(peaks, key=lambda p: -p[0]):
        if all(np.linalg.norm(centre - other) > settings.peaks_apart_cells * cell_mm for other, _ in chosen):
            chosen.append((centre, radius))
    return chosen[: settings.peaks_per_hollow * settings.max_hollows]


def _fitted(faces: _Faces, centre: FloatArray, radius: float, settings: HollowSettings) -> Socket | None:
    """Settle on the largest sphere about a peak: hypotheses from pairs of points, then least squares on its points."""
    likeliest = _likeliest(faces, centre, radius, settings)
    if likeliest is None:
        return None
    centre, radius = likeliest
    on = np.zeros(len(faces.middles), dtype=np.bool_)
    for _ in range(settings.fit_passes):
        on = faces.on_sphere(centre, radius, settings.on_mm, settings.on_cosine)
        if on.sum() < settings.min_faces:
            return None
        centre, radius = _sphere_through(faces.middles[on], faces.areas[on])
    smallest = settings.min_radius_mm * (1.0 - settings.radius_leeway)
    if not smallest < radius < settings.max_radius_mm * (1.0 + settings.radius_leeway):
        return None
    areas = faces.areas[on]
    axis = ((centre - faces.middles[on]) * areas[:, None]).sum(axis=0)
    return Socket(centre=centre, radius_mm=radius, axis=axis / np.linalg.norm(axis), area_mm2=float(areas.sum()))


def _likeliest(
    faces: _Faces, centre: FloatArray, radius: float, settings: HollowSettings
) -> tuple[FloatArray, float] | None:
    """Centre (3,) and radius of the sphere about a peak that most of the faces near it lie on."""
    rng = np.random.default_rng(0)
    near = np.flatnonzero(faces.on_sphere(centre, radius, settings.near_mm, settings.near_cosine))
    if len(near) < settings.min_faces:
        return None
    share = faces.areas[near] / faces.areas[near].sum()
    first, second = rng.choice(near, (2, settings.hypotheses), p=share)
    centres, radii = _spheres_of_pairs(faces, first, second)
    valid = np.linalg.norm(centres - centre, axis=1) < settings.max_change_mm
    valid &= np.abs(radii - radius) < settings.max_change_mm
    judged = rng.choice(near, settings.judged_points, p=share)
    if not valid.any():
        return None
    points, width = faces.middles[judged] - centre, settings.judged_width_mm
    support = soft_count(centres[valid] - centre, radii[valid], points, width)
    chosen = int(np.argmax(support))
    return centres[valid][chosen], float(radii[valid][chosen])


def _sphere_through(points: FloatArray, areas: FloatArray) -> tuple[FloatArray, float]:
    """Centre (3,) and radius of the sphere through points (N, 3), linear least squares weighted by areas (N,)."""
    weight = np.sqrt(areas)[:, None]
    rows = np.column_stack([2.0 * points, np.ones(len(points))])
    x = np.linalg.lstsq(rows * weight, (points**2).sum(axis=1) * weight[:, 0], rcond=None)[0]
    centre = x[:3]
    return centre, float(np.sqrt(max(x[3] + centre @ centre, SMALLEST_SQUARE_MM2)))


def _spheres_of_pairs(faces: _Faces, first: IntArray, second: IntArray) -> tuple[FloatArray, FloatArray]:
    """Spheres (K,) through pairs of points, centred where their normals pass each other most closely."""
    points, normals = faces.middles, faces.normals
    n1, n2, between = normals[first], normals[second], points[second] - points[first]
    cosine = np.einsum("ij,ij->i", n1, n2)
    along1, along2 = np.einsum("ij,ij->i", between, n1), np.einsum("ij,ij->i", between, n2)
    sine2 = np.maximum(1.0 - cosine**2, SMALLEST_SINE2)
    s1, s2 = (along1 - cosine * along2) / sine2, (cosine * along1 - along2) / sine2
    centres = (points[first] + s1[:, None] * n1 + points[second] + s2[:, None] * n2) / 2.0
    return centres, (s1 + s2) / 2.0
