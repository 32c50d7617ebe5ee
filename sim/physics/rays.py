"""The first triangle that a ray meets: by Embree where it is available, else by plain numpy (slow)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
MISS = -1


class Caster(Protocol):
    """A mesh that rays can be cast on."""

    def run(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> NDArray[np.int32]:
        """Get the first face (N,) that each ray meets; -1 for none."""


def caster(corners: FloatArray) -> Caster:
    """Make a caster for triangles ``corners`` (F, 3, 3)."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        return NumpyCaster(corners)
    scene: Caster = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(corners, dtype=np.float32))
    return scene


class NumpyCaster:
    """Every ray against every triangle (Moeller and Trumbore, J. Graphics Tools 2 (1997) 21)."""

    def __init__(self, corners: FloatArray) -> None:
        self._a = corners[:, 0]
        self._ab = corners[:, 1] - corners[:, 0]
        self._ac = corners[:, 2] - corners[:, 0]

    def run(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> NDArray[np.int32]:
        """Get the first face (N,) that each ray meets; -1 for none."""
        rays = zip(origins.astype(np.float64), directions.astype(np.float64), strict=True)
        return np.array([self._first(origin, direction) for origin, direction in rays], dtype=np.int32)

    def _first(self, origin: FloatArray, direction: FloatArray) -> int:
        p = np.cross(direction, self._ac)
        determinant = np.einsum("ij,ij->i", self._ab, p)
        s = origin - self._a
        q = np.cross(s, self._ab)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", s, p) / determinant
            v = q @ direction / determinant
            t = np.einsum("ij,ij->i", self._ac, q) / determinant
            met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if not met.any():
            return MISS
        return int(np.argmin(np.where(met, t, np.inf)))
