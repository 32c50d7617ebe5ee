"""Exact closest points on a triangle surface, with a sign and a normal that are right on edges and corners too."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray, IntArray
from picoradar.registration.model.mesh import face_normals_and_areas
from picoradar.registration.model.rays import EmbreeRays, Rays, TreeRays, first_hits

CAST_AT_ONCE = 32_000
"""Beams cast in one go: what one needs on the way is ten times what is kept of it."""

ON_EDGE = 1e-9
"""Share of a corner in a place on a face below which the place lies on the edge opposite."""

TOUCHING_MM = 1e-6
"""Nearer than this the direction to the surface is rounding; the pseudonormal stands in."""


@dataclass(frozen=True)
class Closest:
    """Closest points of a query.

    Attributes
    ----------
    points : (N, 3) array
        On the surface.
    normals : (N, 3) array
        Unit gradients of the signed distance: from the surface point to the query off the surface, and the
        pseudonormal on it. Gauss-Newton on these converges where face normals make it circle about edges.
    signed_mm : (N,) array
        Distance, positive on the side that the normals point to (outside bone).
    faces : (N,) array of int
        Face that holds the point.
    """

    points: FloatArray
    normals: FloatArray
    signed_mm: FloatArray
    faces: IntArray


class Surface:
    """Triangles with a bounding-volume tree (libigl's AABB, float64, exact).

    Parameters
    ----------
    vertices : (V, 3) array
        mm.
    faces : (F, 3) array of int64
    border : (F, 3) array of bool, optional
        See the attribute; found in the faces when not given.

    Notes
    -----
    The sign follows the angle-weighted pseudonormal (Baerentzen and Aanaes, IEEE TVCG 11:243, 2005).
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, border: BoolArray | None = None) -> None:
        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        self._given_border = border

    @cached_property
    def border(self) -> BoolArray:
        """Edges (F, 3), each opposite a face's corner, on the border of an open model.

        What was cut out of a model keeps those, and gets no others.
        """
        if self._given_border is not None:
            return self._given_border
        _, edge, times = np.unique(self._edge_keys, return_inverse=True, return_counts=True)
        return np.asarray((times[edge] == 1).reshape(-1, 3))

    @property
    def _edge_keys(self) -> IntArray:
        """A number (3 F,) for each edge, opposite each face's corners: the same in both faces that share it."""
        pairs = np.sort(self.faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
        return np.asarray(pairs[:, 0] * len(self.vertices) + pairs[:, 1])

    @cached_property
    def _border_vertices(self) -> BoolArray:
        on = np.zeros(len(self.vertices), dtype=np.bool_)
        for k in range(3):
            edges = self.faces[self.border[:, k]]
            on[edges[:, (k + 1) % 3]] = True
            on[edges[:, (k + 2) % 3]] = True
        return on

    @cached_property
    def _normals_and_areas(self) -> tuple[FloatArray, FloatArray]:
        return face_normals_and_areas(self.vertices, self.faces)

    @property
    def face_normals(self) -> FloatArray:
        """Unit normals (F, 3)."""
        return self._normals_and_areas[0]

    @property
    def face_areas(self) -> FloatArray:
        """Areas (F,) in mm^2."""
        return self._normals_and_areas[1]

    @cached_property
    def tree(self) -> Any:
        """libigl's tree over the faces, made when first asked for."""
        import igl

        tree = igl.AABB()
        tree.init(self.vertices, self.faces)
        return tree

    def distances(self, points: FloatArray) -> FloatArray:
        """Unsigned exact distances (N,) in mm."""
        squared, _, _ = self.tree.squared_distance(self.vertices, self.faces, np.ascontiguousarray(points))
        return np.asarray(np.sqrt(squared), dtype=np.float64)

    def closest(self, points: FloatArray) -> Closest:
        """Closest points of `points` (N, 3) mm."""
        _, faces, foot = self.tree.squared_distance(self.vertices, self.faces, np.ascontiguousarray(points))
        normals = self._pseudonormals(faces, foot)
        offset = points - foot
        along = np.einsum("ij,ij->i", offset, normals)
        distance = np.sqrt(np.einsum("ij,ij->i", offset, offset))
        signed = np.where(along < 0, -distance, distance)
        off = distance > TOUCHING_MM
        normals[off] = offset[off] / signed[off, None]
        return Closest(points=foot, normals=normals, signed_mm=signed, faces=faces)

    def cast(self, origins: FloatArray, directions: FloatArray) -> tuple[IntArray, FloatArray]:
        """First hits along unit `directions` from `origins`, both (N, 3).

        Returns
        -------
        faces : (N,) array of int64
            -1 where nothing is met.
        distances : (N,) array
            mm; infinite where nothing is met.
        """
        faces, distances = np.empty(len(directions), dtype=np.int64), np.empty(len(directions))
        for first in range(0, len(directions), CAST_AT_ONCE):
            some = slice(first, first + CAST_AT_ONCE)
            faces[some], distances[some] = first_hits(
                self._rays, origins[some], directions[some], self._first_corners, self.face_normals
            )
        return faces, distances

    @cached_property
    def _rays(self) -> Rays:
        try:
            return EmbreeRays(self.vertices, self.faces)
        except ImportError:
            return TreeRays(self.vertices, self.faces, self.tree)

    @cached_property
    def _first_corners(self) -> FloatArray:
        return np.asarray(self.vertices[self.faces[:, 0]], dtype=np.float64)

    def first_hit(self, origins: FloatArray, directions: FloatArray) -> FloatArray:
        """Distances (N,) mm along unit `directions` from `origins`, both (N, 3); infinite where nothing is met.

        In double precision throughout: beams may start on the surface itself.
        """
        rays = TreeRays(self.vertices, self.faces, self.tree)
        return first_hits(rays, origins, directions, self._first_corners, self.face_normals)[1]

    @cached_property
    def corner_angles(self) -> FloatArray:
        """Inner angles (F, 3) in rad."""
        corners = self.vertices[self.faces]
        angles = np.empty(self.faces.shape)
        for k in range(3):
            u, w = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
            angles[:, k] = np.arctan2(np.linalg.norm(np.cross(u, w), axis=1), np.einsum("ij,ij->i", u, w))
        return angles

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """Angle-weighted unit normals of the vertices (V, 3)."""
        total = np.zeros_like(self.vertices)
        for axis in range(3):
            for k in range(3):
                weights = self.face_normals[:, axis] * self.corner_angles[:, k]
                total[:, axis] += np.bincount(self.faces[:, k], weights=weights, minlength=len(self.vertices))
        length = np.maximum(np.linalg.norm(total, axis=1), np.finfo(np.float64).tiny)
        return np.asarray(total / length[:, None], dtype=np.float64)

    @cached_property
    def edge_normals(self) -> FloatArray:
        """Unit normals (F, 3, 3) of the edges opposite each face's corners, both neighbours' normals summed."""
        _, edge = np.unique(self._edge_keys, return_inverse=True)
        own = np.repeat(self.face_normals, 3, axis=0)
        total: FloatArray = np.zeros((int(edge.max()) + 1, 3))
        for axis in range(3):
            total[:, axis] = np.bincount(edge, weights=own[:, axis])
        unit: FloatArray = total / np.maximum(np.linalg.norm(total, axis=1), np.finfo(np.float64).tiny)[:, None]
        return unit[edge].reshape(-1, 3, 3)

    @cached_property
    def principal_frame(self) -> tuple[FloatArray, FloatArray]:
        """Centroid (3,) mm of the area, and its principal axes, the columns of (3, 3), smallest extent first."""
        middle = self.vertices[self.faces].mean(axis=1)
        share = self.face_areas / self.face_areas.sum()
        centroid = share @ middle
        local = middle - centroid
        return centroid, np.asarray(np.linalg.eigh((local * share[:, None]).T @ local)[1], dtype=np.float64)

    def _pseudonormals(self, faces: IntArray, foot: FloatArray) -> FloatArray:
        normals = self.face_normals[faces].copy()
        zero = self._off_edges(faces, foot)
        count = zero.sum(axis=1)
        on_edge, on_corner = np.flatnonzero(count == 1), np.flatnonzero(count == 2)
        normals[on_edge] = self.edge_normals[faces[on_edge], zero[on_edge].argmax(axis=1)]
        corner = (~zero[on_corner]).argmax(axis=1)
        normals[on_corner] = self.vertex_normals[self.faces[faces[on_corner], corner]]
        return normals

    def beyond_border(self, found: Closest) -> BoolArray:
        """Points (N,) beyond the border of an open model: on the border lies what is closest to them."""
        if not self.border.any():
            return np.zeros(len(found.faces), dtype=np.bool_)
        zero = self._off_edges(found.faces, found.points)
        count = zero.sum(axis=1)
        on_edge = self.border[found.faces, zero.argmax(axis=1)] & (count == 1)
        corner = self.faces[found.faces, (~zero).argmax(axis=1)]
        return np.asarray(on_edge | (self._border_vertices[corner] & (count == 2)))

    def _off_edges(self, faces: IntArray, foot: FloatArray) -> BoolArray:
        """Corners (N, 3) of the faces whose share in the feet (N, 3) is nil: one on an edge, two on a corner."""
        corners = self.vertices[self.faces[faces]]
        area = 2.0 * self.face_areas[faces]
        share = np.empty((len(faces), 3))
        for k in range(3):
            edge = corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3]
            across = np.cross(edge, foot - corners[:, (k + 1) % 3])
            share[:, k] = np.einsum("ij,ij->i", across, self.face_normals[faces]) / area
        return share < ON_EDGE


def part(surface: Surface, keep: BoolArray) -> Surface:
    """Return the faces of `surface` marked in `keep` (F,) as a surface of their own."""
    used, flat = np.unique(surface.faces[keep], return_inverse=True)
    return Surface(surface.vertices[used], flat.reshape(-1, 3).astype(np.int64), surface.border[keep])
