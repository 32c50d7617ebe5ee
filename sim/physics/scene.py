"""`Scene`: the target in front of the scanner, hit by rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.materials import Material, backscatter
from picoradar.sim.physics.rays import MISS, caster

FloatArray = NDArray[np.float64]

WIDEST_SPOT_MM = 20.0  # diameter; beyond it from the edge of the mark, none of a beam's rays can meet it


class Hits(NamedTuple):
    """Where N rays meet the target: ``distance_mm`` (N,) (inf where they miss), ``face`` (N,) (-1 where they miss),
    ``cosine`` (N,) of the incidence angle, and ``brightness`` (N,), the backscattered light relative to a white
    Lambertian at normal incidence (0 where they miss)."""

    distance_mm: FloatArray
    face: NDArray[np.int64]
    cosine: FloatArray
    brightness: FloatArray


@dataclass(frozen=True)
class Target:
    """A body in its own frame.

    Attributes
    ----------
    name : str
    vertices : (V, 3) float array
        mm.
    faces : (F, 3) int array
    materials : tuple of Material
    face_material : (F,) int array
        Index into ``materials`` for each face.
    """

    name: str
    vertices: FloatArray
    faces: NDArray[np.int64]
    materials: tuple[Material, ...]
    face_material: NDArray[np.int64]

    def joined(self, other: Target) -> Target:
        """Get this body with another one, in the same frame, added to it."""
        return Target(
            self.name,
            np.vstack([self.vertices, other.vertices]),
            np.vstack([self.faces, other.faces + len(self.vertices)]),
            self.materials + other.materials,
            np.concatenate([self.face_material, other.face_material + len(self.materials)]),
        )


class Scene:
    """Ray casting on a target at some pose in the scanner frame.

    Embree finds the face in single precision; the hit is then the intersection with the plane of that face in
    double precision. Both sides of a face reflect.

    Parameters
    ----------
    target : Target
        The body.
    scanner_from_model : (4, 4) array
        Its pose, mm.
    mark : Target, optional
        A plate in the scanner's own frame, which stands still when the target moves.

    Raises
    ------
    ValueError
        When no triangle of the target has an area, or a coordinate is not finite.
    """

    def __init__(self, target: Target, scanner_from_model: FloatArray, mark: Target | None = None) -> None:
        self.target = target
        self.scanner_from_model = np.array(scanner_from_model, dtype=np.float64)
        vertices = target.vertices @ self.scanner_from_model[:3, :3].T + self.scanner_from_model[:3, 3]
        corners = vertices[target.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if not np.isfinite(corners).all() or not (lengths > 0).any():
            raise ValueError(f"target {target.name}: needs finite vertices and at least one triangle with an area")
        keep = lengths[:, 0] > 0
        normals = normals[keep] / lengths[keep]
        offsets = np.einsum("ij,ij->i", normals, corners[keep, 0])
        surfaces = np.array([material.coefficients() for material in target.materials])[target.face_material[keep]]
        self._faces = np.column_stack([normals, offsets, surfaces])
        self._face_material = target.face_material[keep]
        self._caster = caster(corners[keep])
        self._mark = None if mark is None else Scene(mark, np.eye(4))
        if mark is not None:
            self._mark_middle = mark.vertices.mean(axis=0)
            half_mm = float(np.linalg.norm(mark.vertices - self._mark_middle, axis=1).max())
            self._mark_reach_mm = half_mm + WIDEST_SPOT_MM

    def material_numbers(self, faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """Get the numbers (N,) of the materials of faces that rays hit: the target's, and after them the mark's."""
        own = len(self._face_material)
        if self._mark is None or not (faces >= own).any():
            return np.asarray(self._face_material[faces])
        of_mark = len(self.target.materials) + self._mark._face_material[np.maximum(faces - own, 0)]
        of_target = self._face_material[np.minimum(faces, own - 1)]
        return np.asarray(np.where(faces >= own, of_mark, of_target), dtype=np.int64)

    def material(self, number: int) -> Material:
        """Get the material of a number of `material_numbers`."""
        own = len(self.target.materials)
        if self._mark is None or number < own:
            return self.target.materials[number]
        return self._mark.target.materials[number - own]

    def in_model(self, point_mm: FloatArray) -> FloatArray:
        """Get a point (3,) of the scanner frame in the target's own frame, mm."""
        return np.asarray((point_mm - self.scanner_from_model[:3, 3]) @ self.scanner_from_model[:3, :3])

    def cast(self, origins: FloatArray, directions: FloatArray, nearer_mm: float = 0.0) -> Hits:
        """Follow rays to the target, or to the mark where that stands before it.

        Parameters
        ----------
        origins : (N, 3) array
            Scanner frame, mm.
        directions : (N, 3) or (3,) array
            Unit vectors; a single one is that of all rays.
        nearer_mm : float
            How far the target, but not the mark, has moved along -z.

        Returns
        -------
        Hits
        """
        moved = origins if nearer_mm == 0.0 else origins + (0.0, 0.0, nearer_mm)
        hits = self._cast(moved, directions)
        if self._mark is None or not self._near_mark(origins, directions):
            return hits
        first = self._mark._cast(origins, directions)
        before = first.distance_mm < hits.distance_mm
        if before.any():
            faces = first.face + len(self._face_material)
            replaced = ((first.distance_mm, faces, first.cosine, first.brightness), hits)
            hits = Hits(*(np.where(before, mark, target) for mark, target in zip(*replaced, strict=True)))
        return hits

    def _near_mark(self, origins: FloatArray, directions: FloatArray) -> bool:
        """Get whether the first ray of a beam passes so near the mark that one of its rays may hit it."""
        way = self._mark_middle - origins[0]
        along = float(way @ (directions if directions.ndim == 1 else directions[0]))
        return float(way @ way) - along * along < self._mark_reach_mm**2

    def _cast(self, origins: FloatArray, directions: FloatArray) -> Hits:
        each = np.empty(origins.shape, dtype=np.float32)
        each[:] = directions
        face = self._caster.run(origins.astype(np.float32), each)
        surface = self._faces[face]  # for a miss the last face, of no consequence
        normal = surface[:, :3]
        slope = normal @ directions if directions.ndim == 1 else np.einsum("ij,ij->i", normal, directions)
        height = surface[:, 3] - np.einsum("ij,ij->i", normal, origins)
        distance = np.divide(height, slope, out=np.full(len(face), np.inf), where=slope != 0)
        cosine = np.abs(slope)
        brightness = backscatter(cosine, surface[:, 4:])
        missed = (face == MISS) | (distance <= 0) | (distance == np.inf)
        if missed.any():
            distance[missed], cosine[missed], brightness[missed], face[missed] = np.inf, 0.0, 0.0, MISS
        return Hits(distance, face.astype(np.int64), cosine, brightness)
