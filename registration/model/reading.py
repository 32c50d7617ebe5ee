"""Vertices and triangles out of the bytes of a mesh file; whatever is wrong with them becomes a `MeshError`."""

from __future__ import annotations

import io
import logging
from pathlib import Path
from typing import Any

import numpy as np

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.errors import DECODER_ERRORS, MeshError
from picoradar.registration.model.glb import check_glb
from picoradar.registration.model.limits import MOST_FACES
from picoradar.registration.model.vtp import read_vtp

_STL_HEAD, _STL_FACE = 84, 50  # bytes of a binary STL before its triangles, and of each


def read_mesh(file: Path, content: bytes) -> tuple[FloatArray, IntArray]:
    """Read vertices (V, 3) and triangles (F, 3).

    Parameters
    ----------
    file : Path
        For its ending and for messages.
    content : bytes
        What it holds. Nothing else is read: textures, materials and buffers in other files are left alone.

    Raises
    ------
    MeshError
        Naming the file, what was found and what to do.
    """
    suffix = file.suffix.lower()
    try:
        if suffix == ".vtp":
            vertices, faces = read_vtp(content)
        else:
            vertices, faces = _with_trimesh(suffix, _prepared(suffix, content))
        if len(faces) > MOST_FACES:
            raise ValueError(f"it has {len(faces)} triangles; at most {MOST_FACES} are read: simplify it")
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from error
    except DECODER_ERRORS as error:
        raise MeshError(f"{file}: cannot be read as a mesh ({_words(error)}); export it again") from error
    return vertices, faces


def _with_trimesh(suffix: str, content: bytes) -> tuple[FloatArray, IntArray]:
    import trimesh

    trimesh.util.log.setLevel(logging.CRITICAL)  # it shows tracebacks of what it tries and does without
    try:
        loaded: Any = trimesh.load(
            io.BytesIO(content), file_type=suffix[1:], process=False, skip_materials=True, allow_remote=False
        )
        mesh: Any = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except Exception as error:  # a reader may fail in any way on a damaged file; all mean the same here
        raise ValueError(_words(error)) from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise MeshError(f"holds no triangles (a {type(mesh).__name__}); give a surface mesh")
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)


def _prepared(suffix: str, content: bytes) -> bytes:
    """Check what the file states of its size; text in an encoding other than UTF-8 becomes UTF-8.

    Names of patients stand in comments, often in Latin-1. Each byte is a character there, and all that counts in these
    formats is ASCII, so that nothing need be guessed.
    """
    if suffix == ".glb":
        check_glb(content)
        return content
    if suffix == ".stl" and not _is_text_stl(content):
        return content
    if suffix == ".ply" and b"format ascii" not in content[:1000]:
        return content
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1").encode("utf-8")
    return content


def _is_text_stl(content: bytes) -> bool:
    """Tell text from binary; a binary file may begin with ``solid``, too, but not one that is cut short.

    Raises
    ------
    MeshError
        If it is neither text nor as long as its number of triangles says.
    """
    stated = int.from_bytes(content[80:84], "little")
    if len(content) >= _STL_HEAD and len(content) == _STL_HEAD + _STL_FACE * stated:
        return False
    if not content or (content[:5].lower() == b"solid" and b"\0" not in content):
        return True
    held = max(0, (len(content) - _STL_HEAD) // _STL_FACE)
    raise MeshError(
        f"no readable mesh: its header says {stated} triangles, the file has room for {held}; "
        "it is truncated or no STL; export it again"
    )


def _words(error: Exception) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__
