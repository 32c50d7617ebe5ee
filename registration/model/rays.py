"""First hits of beams on a mesh: the face by Embree in single precision, the place on its plane in double.

Where there is no build of Embree, libigl's tree finds the faces at a fifth of the speed.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from picoradar.registration._types import FloatArray, IntArray

GRAZING = 1e-6
"""Smallest cosine to a face's normal: along a plane there is no place where a beam meets it."""


class Rays(Protocol):
    """A mesh that beams can be cast on."""

    def faces_met(self, origins: FloatArray, directions: FloatArray) -> IntArray:
        """Get the first face (N,) that each beam meets; -1 for none."""


class EmbreeRays:
    """A mesh in Embree.

    Parameters
    ----------
    vertices : (V, 3) array
        mm; taken about their middle, for single precision.
    faces : (F, 3) array

    Raises
    ------
    ImportError
        When Embree is not installed.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._middle = vertices.mean(axis=0)
        self._scene: Any = EmbreeScene()
        TriangleMesh(
            self._scene, np.asarray(vertices - self._middle, np.float32), np.ascontiguousarray(faces, np.int32)
        )

    def faces_met(self, origins: FloatArray, directions: FloatArray) -> IntArray:
        """Get the first face (N,) that each beam meets; -1 for none."""
        begin = np.ascontiguousarray(origins - self._middle, dtype=np.float32)
        found = self._scene.run(begin, np.ascontiguousarray(directions, dtype=np.float32))
        return np.asarray(found, dtype=np.int64)


class TreeRays:
    """A mesh in libigl's tree.

    Parameters
    ----------
    vertices : (V, 3) array
    faces : (F, 3) array
    tree : igl.AABB
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, tree: Any) -> None:
        self._mesh, self._tree = (vertices, faces), tree

    def faces_met(self, origins: FloatArray, directions: FloatArray) -> IntArray:
        """Get the first face (N,) that each beam meets; -1 for none."""
        begin, along = np.ascontiguousarray(origins), np.ascontiguousarray(directions)
        return np.asarray(self._tree.intersect_ray_first(*self._mesh, begin, along)[0], dtype=np.int64)


def first_hits(
    rays: Rays, origins: FloatArray, directions: FloatArray, corners: FloatArray, normals: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Get faces (N,) and distances (N,) of first hits, for one corner (F, 3) and unit normal (F, 3) of each face.

    Parameters
    ----------
    rays : Rays
    origins, directions : (N, 3) arrays
        Directions of unit length.
    corners, normals : (F, 3) arrays

    Returns
    -------
    faces : (N,) array of int64
        -1 where nothing is met.
    distances : (N,) array
        mm; infinite where nothing is met.
    """
    faces = rays.faces_met(origins, directions)
    normal = normals[faces]
    height = np.einsum("ij,ij->i", corners[faces] - origins, normal)
    slope = np.einsum("ij,ij->i", directions, normal)
    met = (faces >= 0) & (np.abs(slope) > GRAZING)
    distances = np.divide(height, slope, out=np.full(len(faces), np.inf), where=met)
    return np.where(met, faces, -1), distances
