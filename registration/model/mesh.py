"""Validation and repair of a triangle mesh: what was found, what was repaired, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.errors import MeshError

MIN_AREA_SHARE = 1e-14
"""Faces with a smaller share of the squared size of the mesh have no area but for rounding."""

SMALLEST_EXTENT_MM, LARGEST_EXTENT_MM = 1.0, 1000.0
"""Longest edge of a model's bounding box, mm: below it is in metres; above it is farther than the radar reaches
(dissertation, chapter 1), in micrometres, or has a vertex astray. The preparation's memory goes with the volume."""


@dataclass(frozen=True)
class MeshReport:
    """What validation found and repaired.

    Attributes
    ----------
    extent_mm : tuple of three floats
        Edges of the bounding box.
    closed : bool
        Every edge belongs to exactly two faces, so that there is an inside.
    open_edges, odd_edges : int
        Edges with one face (rims of holes), and with more than two.
    merged_vertices, removed_faces : int
        Duplicate vertices merged; degenerate, tiny or doubled faces left out.
    turned_inside_out : bool
        The faces of a closed mesh pointed inward and were flipped.
    findings : tuple of sentences
        The same in words, for a person.
    """

    extent_mm: tuple[float, float, float]
    closed: bool
    open_edges: int
    odd_edges: int
    merged_vertices: int
    removed_faces: int
    turned_inside_out: bool
    findings: tuple[str, ...]


def validated(vertices: npt.ArrayLike, faces: npt.ArrayLike) -> tuple[FloatArray, IntArray, MeshReport]:
    """Check and repair a mesh.

    Parameters
    ----------
    vertices : (V, 3) array
        Millimetres.
    faces : (F, 3) array of int
        Indices of vertices, counter-clockwise seen from outside.

    Returns
    -------
    vertices : (V', 3) array
    faces : (F', 3) array of int64
    report : MeshReport

    Raises
    ------
    MeshError
        If there is no surface, coordinates are not finite, indices are out of range, or the size says another unit.
    """
    v, f = _checked_arrays(vertices, faces)
    extent = v[np.unique(f)].max(axis=0) - v[np.unique(f)].min(axis=0)
    _refuse_wrong_unit(extent)
    v, f, merged = _merged(v, f)
    kept = _sound_faces(v, f, float(extent.max()))
    removed = int(len(f) - kept.sum())
    f = f[kept]
    if len(f) == 0:
        raise MeshError("the mesh has no face with an area: it is no surface; export it again as a triangle mesh")
    used, flat = np.unique(f, return_inverse=True)
    v, f = np.ascontiguousarray(v[used]), np.ascontiguousarray(flat.reshape(-1, 3).astype(np.int64))
    open_edges, odd_edges = _edge_counts(f)
    closed = open_edges == 0 and odd_edges == 0
    inside_out = closed and signed_volume(v, f) < 0
    if inside_out:
        f = np.ascontiguousarray(f[:, ::-1])
    findings = []
    if merged:
        findings.append(f"{merged} duplicate vertices were merged")
    if removed:
        findings.append(f"{removed} faces without area, or given twice, were left out")
    if inside_out:
        findings.append("the faces pointed inward and were turned round")
    if open_edges:
        findings.append(f"the surface is open: {open_edges} edges belong to one face only")
    if odd_edges:
        findings.append(f"{odd_edges} edges belong to more than two faces")
    report = MeshReport(
        extent_mm=(float(extent[0]), float(extent[1]), float(extent[2])),
        closed=closed,
        open_edges=open_edges,
        odd_edges=odd_edges,
        merged_vertices=merged,
        removed_faces=removed,
        turned_inside_out=inside_out,
        findings=tuple(findings),
    )
    return v, f, report


def signed_volume(vertices: FloatArray, faces: IntArray) -> float:
    """Volume in mm^3 of a closed mesh, positive when its faces point outward."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def face_normals_and_areas(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (F, 3) and areas (F,) in mm^2."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, np.finfo(np.float64).tiny)[:, None], length / 2.0


def _checked_arrays(vertices: npt.ArrayLike, faces: npt.ArrayLike) -> tuple[FloatArray, IntArray]:
    v = np.asarray(vertices, dtype=np.float64)
    given = np.asarray(faces)
    if v.size == 0 or given.size == 0:
        raise MeshError(f"the mesh is empty ({len(v)} vertices, {len(given)} faces): export the surface again")
    if v.ndim != 2 or v.shape[1] != 3 or given.ndim != 2 or given.shape[1] != 3:
        raise MeshError(f"vertices {v.shape} and faces {given.shape}: a triangle mesh has (V, 3) and (F, 3)")
    if not np.issubdtype(given.dtype, np.integer):
        raise MeshError(f"faces are of type {given.dtype}: they are whole numbers, indices of vertices")
    f = np.asarray(given, dtype=np.int64)
    if not np.isfinite(v).all():
        bad = int(np.argmin(np.isfinite(v).all(axis=1)))
        raise MeshError(
            f"vertex {bad} is {v[bad].tolist()}: NaN or infinite coordinates; repair or export the mesh again"
        )
    if f.min() < 0 or f.max() >= len(v):
        raise MeshError(
            f"faces name vertices {int(f.min())} to {int(f.max())}, but there are {len(v)}: the mesh is damaged"
        )
    return v, f


def _refuse_wrong_unit(extent: FloatArray) -> None:
    longest = float(extent.max())
    if longest < SMALLEST_EXTENT_MM:
        raise MeshError(
            f"the largest edge of the model's bounding box is {longest:.3g}: the model seems to be in metres; "
            "scale it by 1000 so that it is in millimetres"
        )
    if longest > LARGEST_EXTENT_MM:
        raise MeshError(
            f"the largest edge of the model's bounding box is {longest:.4g} mm, more than {LARGEST_EXTENT_MM:g}: "
            "the model is in another unit, or a vertex lies far outside; scale it, or leave that vertex out"
        )


def _merged(v: FloatArray, f: IntArray) -> tuple[FloatArray, IntArray, int]:
    """Merge vertices with exactly equal coordinates (as the corners of an STL file)."""
    order = np.lexsort(v.T)
    ordered = v[order]
    first = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    merged = int(len(v) - first.sum())
    if merged == 0:
        return v, f, 0
    target = np.empty(len(v), dtype=np.int64)
    target[order] = np.cumsum(first) - 1
    return ordered[first], target[f], merged


def _sound_faces(v: FloatArray, f: IntArray, size: float) -> npt.NDArray[np.bool_]:
    """Faces with three different corners and an area, each only once."""
    sound = face_normals_and_areas(v, f)[1] > MIN_AREA_SHARE * size * size
    corners = np.sort(f, axis=1)
    order = np.lexsort(corners.T)
    same = (corners[order][1:] == corners[order][:-1]).all(axis=1)
    sound[order[1:][same]] = False
    return sound


def _edge_counts(f: IntArray) -> tuple[int, int]:
    """Numbers of edges with one face, and with more than two."""
    edges = np.sort(f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    key = np.sort(edges[:, 0] * (int(f.max()) + 1) + edges[:, 1])
    starts = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    counts = np.diff(np.concatenate([starts, [len(key)]]))
    return int((counts == 1).sum()), int((counts > 2).sum())
