"""Corners of a model's flat faces: what manufactured bodies have, and bone does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.model.surface import Surface
from picoradar.registration.settings import EdgeSettings


@dataclass(frozen=True)
class FlatFace:
    """A flat face with its corners.

    Attributes
    ----------
    triangles : (T,) array of int
    frames : (C, 2, 4, 4) array
        Of each corner two frames, whose z axis is the face's normal and whose origin is the corner: x along the edge
        that ends there, and along the one that begins there.
    """

    triangles: IntArray
    frames: FloatArray


def flat_faces(surface: Surface, settings: EdgeSettings) -> list[FlatFace]:
    """The flat faces of a surface that have corners, those with the largest triangles first."""
    normals, areas = surface.face_normals, surface.face_areas
    corners = surface.vertices[surface.faces]
    left = np.ones(len(areas), dtype=np.bool_)
    found: list[FlatFace] = []
    for _ in range(settings.searched_planes):
        if not left.any():
            break
        largest = int(np.argmax(np.where(left, areas, -1.0)))
        heights = (corners - corners[largest, 0]) @ normals[largest]
        flat = left & (np.abs(heights).max(axis=1) < settings.flat_mm) & (normals @ normals[largest] > 0.0)
        left &= ~flat
        left[largest] = False
        if areas[flat].sum() >= settings.min_face_share * areas.sum():
            triangles = np.flatnonzero(flat)
            frames = _corner_frames(surface, triangles, normals[largest], settings.min_corner_sine)
            if 0 < len(frames) <= settings.max_corners:
                found.append(FlatFace(triangles, frames))
    return found


def _corner_frames(surface: Surface, triangles: IntArray, normal: FloatArray, min_sine: float) -> FloatArray:
    """Frames (C, 2, 4, 4) of the corners of these triangles' common outline."""
    faces = surface.faces[triangles]
    edges = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    outline = [(a, b) for a, b in edges if (b, a) not in edges]
    before = {b: a for a, b in outline}
    frames = []
    for at, after in sorted(outline):
        if at not in before:
            continue  # of an open outline
        point = surface.vertices[at]
        ends, begins = (_unit(v) for v in (point - surface.vertices[before[at]], surface.vertices[after] - point))
        if np.linalg.norm(np.cross(ends, begins)) >= min_sine:
            frames.append([_frame(point, along, normal) for along in (ends, begins)])
    return np.array(frames).reshape(-1, 2, 4, 4)


def _frame(point: FloatArray, along: FloatArray, normal: FloatArray) -> FloatArray:
    frame = np.eye(4)
    frame[:3, 0] = _unit(along - (along @ normal) * normal)
    frame[:3, 1], frame[:3, 2], frame[:3, 3] = np.cross(normal, frame[:3, 0]), normal, point
    return frame


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), np.finfo(np.float64).tiny), dtype=np.float64)
