"""What a scanner can see of a model: a beam ends on the side of a bone that faces the scanner, never behind it."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.errors import MeshError
from picoradar.registration.model.surface import Surface, part
from picoradar.registration.settings import ViewSettings

MIN_COSINE = ViewSettings().min_seen_cosine
"""Of a shell that is made outside of the preparation of a model."""

OFF_FACE_MM = 1e-3
"""Rays to the scanner begin so far off their face, which they would meet else."""


def directions_in_cone(axis: FloatArray, half_angle_deg: float, rings: int = 2, spokes: int = 6) -> FloatArray:
    """Unit vectors (K, 3) that fill a cone about the unit vector `axis`: its axis, then `rings` rings of `spokes`."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    out = [axis]
    for ring in range(1, rings + 1):
        tilt = np.radians(half_angle_deg) * ring / rings
        azimuth = 2.0 * np.pi * np.arange(spokes) / spokes
        around = np.cos(azimuth)[:, None] * u + np.sin(azimuth)[:, None] * v
        out.extend(np.cos(tilt) * axis + np.sin(tilt) * around)
    return np.array(out)


def visible_faces(surface: Surface, to_scanner: FloatArray, whole: Surface, min_cosine: float) -> BoolArray:
    """Faces (F,) that can be seen from at least one of the directions `to_scanner` (K, 3), scanner far away.

    A face is seen when it faces the direction by more than `min_cosine`, and the ray from its centre that way meets
    nothing of `whole`.
    """
    centres = surface.vertices[surface.faces].mean(axis=1) + OFF_FACE_MM * surface.face_normals
    seen = np.zeros(len(surface.faces), dtype=np.bool_)
    for direction in to_scanner:
        facing = np.flatnonzero(~seen & (surface.face_normals @ direction > min_cosine))
        if len(facing) == 0:
            continue
        distance = whole.first_hit(centres[facing], np.broadcast_to(direction, (len(facing), 3)))
        seen[facing[np.isinf(distance)]] = True
    return seen


def visible_shell(
    surface: Surface,
    to_scanner: FloatArray,
    half_angle_deg: float = 25.0,
    only: Surface | None = None,
    min_cosine: float = MIN_COSINE,
) -> Surface:
    """Return the part of a surface that a scanner within `half_angle_deg` of `to_scanner` (3,) can see.

    Parameters
    ----------
    surface : Surface
        All that can stand in the way.
    to_scanner : (3,) array
        Direction from the surface to the scanner.
    half_angle_deg : float
    only : Surface, optional
        Part of `surface` that is wanted.
    min_cosine : float
        Faces seen flatter than this return no echo.

    Raises
    ------
    MeshError
        If nothing can be seen from there.
    """
    axis = to_scanner / np.linalg.norm(to_scanner)
    wanted = only or surface
    seen = visible_faces(wanted, directions_in_cone(axis, half_angle_deg), surface, min_cosine)
    if not seen.any():
        raise MeshError(
            "no face of the model faces the scanner: check the scanner's origin and whether the model is inside out"
        )
    return part(wanted, seen)


UNSEEN_SHARE = 1e-12
"""Weight of faces that are not seen: where nothing is, there is a centroid none the less."""


def visible_centroids(surface: Surface, to_scanner: FloatArray, faces: int = 4000) -> FloatArray:
    """Centroids (K, 3) mm of what is seen from the directions `to_scanner` (K, 3), each face by its projected area.

    Occlusion is not considered: good enough to place a scan of a whole object.
    """
    stride = max(1, len(surface.faces) // faces)
    centres = surface.vertices[surface.faces[::stride]].mean(axis=1)
    seen = np.maximum(to_scanner @ surface.face_normals[::stride].T, 0.0) * surface.face_areas[::stride]
    seen += UNSEEN_SHARE * surface.face_areas[::stride]
    return np.asarray(seen @ centres / seen.sum(axis=1, keepdims=True), dtype=np.float64)
