"""Vertices and triangles of a mesh file that is put in front of the scanner."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.scene import FloatArray


def read_mesh_file(path: str) -> tuple[FloatArray, NDArray[np.int64]]:
    """Read vertices (V, 3) mm and triangles (F, 3); nothing but the file itself is opened.

    Raises
    ------
    ValueError
        When it is no readable mesh, or not in millimetres.
    """
    import trimesh

    try:
        content = Path(path).read_bytes()
        if b"\0" not in content:  # text: a name in another encoding must not keep it from being read
            content = content.decode("utf-8" if _is_utf8(content) else "latin-1").encode("utf-8")
        kind = Path(path).suffix.lower().removeprefix(".")
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=kind, process=False)  # processing would drop NaN
    except Exception as error:  # a reader may fail in any way on a damaged file; all mean the same here
        raise ValueError(f"target {path}: no readable mesh ({error}); give an STL, PLY, OBJ or GLB file") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise ValueError(f"target {path}: holds no triangles; give a surface mesh")
    vertices = np.array(mesh.vertices, dtype=np.float64)
    if not np.isfinite(vertices).all():
        raise ValueError(f"target {path}: {np.count_nonzero(~np.isfinite(vertices))} coordinates are NaN or infinite")
    size = float(np.ptp(vertices, axis=0).max())
    if size < 1.0:
        raise ValueError(f"target {path}: only {size:.3g} mm across; is it in metres? scale it to millimetres")
    return vertices, np.array(mesh.faces, dtype=np.int64)


def _is_utf8(content: bytes) -> bool:
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True
