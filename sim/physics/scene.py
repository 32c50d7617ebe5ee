"""`Scene`: the target in front of the scanner, hit by rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.materials import Material, backscatter
from picoradar.sim.physics.rays import MISS, caster

FloatArray = NDArray[np.float64]


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

    Raises
    ------
    ValueError
        When no triangle of the target has an area, or a coordinate is not finite.
    """

    def __init__(self, target: Target, scanner_from_model: FloatArray) -> None:
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

    def material_numbers(self, faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """Get the numbers (N,), in the target's materials, of those of faces that rays hit."""
        return np.asarray(self._face_material[faces])

    def in_model(self, point_mm: FloatArray) -> FloatArray:
        """Get a point (3,) of the scanner frame in the target's own frame, mm."""
        return np.asarray((point_mm - self.scanner_from_model[:3, 3]) @ self.scanner_from_model[:3, :3])

    def cast(self, origins: FloatArray, directions: FloatArray) -> Hits:
        """Follow rays to the target.

        Parameters
        ----------
        origins : (N, 3) array
            Scanner frame, mm.
        directions : (N, 3) or (3,) array
            Unit vectors; a single one is that of all rays.

        Returns
        -------
        Hits
        """
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
