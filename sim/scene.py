"""`Scene`: the target in front of the scanner, hit by rays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
MISS = -1


class Hits(NamedTuple):
    """Where N rays meet the target: ``distance_mm`` (N,) (inf where they miss), ``face`` (N,) (-1 where
    they miss), ``cosine`` (N,) of the incidence angle, ``reflectance`` (N,) of the face."""

    distance_mm: FloatArray
    face: NDArray[np.int64]
    cosine: FloatArray
    reflectance: FloatArray


@dataclass(frozen=True)
class Target:
    """A body in its own frame.

    Attributes
    ----------
    name : str
    vertices : (V, 3) float array
        mm.
    faces : (F, 3) int array
    reflectance : (F,) float array
        Diffuse reflectance of each face at 904 nm.
    """

    name: str
    vertices: FloatArray
    faces: NDArray[np.int64]
    reflectance: FloatArray


class Scene:
    """Ray casting on a target that stands somewhere in the scanner frame.

    Embree finds the face in single precision; the hit is then the intersection with the plane of that face in
    double precision. Both sides of a face reflect.

    Parameters
    ----------
    target : Target
        The body.
    scanner_from_model : (4, 4) array
        Its pose, mm.
    """

    def __init__(self, target: Target, scanner_from_model: FloatArray) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.target = target
        self.scanner_from_model = np.array(scanner_from_model, dtype=np.float64)
        vertices = target.vertices @ self.scanner_from_model[:3, :3].T + self.scanner_from_model[:3, 3]
        corners = vertices[target.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if not np.isfinite(corners).all() or not (lengths > 0).any():
            raise ValueError(f"target {target.name}: needs finite vertices and at least one triangle with an area")
        keep = lengths[:, 0] > 0
        self._normals = normals[keep] / lengths[keep]
        self._offsets = np.einsum("ij,ij->i", self._normals, corners[keep, 0])
        self._reflectance = target.reflectance[keep]
        self._embree = EmbreeScene()
        self._mesh = TriangleMesh(self._embree, np.ascontiguousarray(corners[keep], dtype=np.float32))

    def cast(self, origins: FloatArray, directions: FloatArray) -> Hits:
        """Follow rays to the target.

        Parameters
        ----------
        origins, directions : (N, 3) arrays
            Scanner frame, mm; unit directions.

        Returns
        -------
        Hits
        """
        face = self._embree.run(origins.astype(np.float32), directions.astype(np.float32)).astype(np.int64)
        hit = np.maximum(face, 0)
        normal = self._normals[hit]
        slope = np.einsum("ij,ij->i", normal, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (self._offsets[hit] - np.einsum("ij,ij->i", normal, origins)) / slope
        seen = (face != MISS) & np.isfinite(distance) & (distance > 0)
        return Hits(
            np.where(seen, distance, math.inf),
            np.where(seen, face, MISS),
            np.where(seen, np.abs(slope), 0.0),
            np.where(seen, self._reflectance[hit], 0.0),
        )


def backscatter(cosine: FloatArray, roughness_rad: float) -> FloatArray:
    """Get what a rough diffuse surface sends back to the source, relative to a white Lambertian at normal incidence.

    Oren and Nayar (SIGGRAPH 1994), first order model, with the eye at the lamp: facets that face the source keep
    a tilted rough surface bright where a smooth one would go as the cosine.

    Parameters
    ----------
    cosine : (N,) array
        Cosine of the incidence angle.
    roughness_rad : float
        Standard deviation of the facets' slope angle; 0 gives Lambert's law.
    """
    variance = roughness_rad**2
    a = 1.0 - 0.5 * variance / (variance + 0.33)
    b = 0.45 * variance / (variance + 0.09)
    return np.asarray(np.where(cosine > 0, a * cosine + b * (1.0 - cosine**2), 0.0))
