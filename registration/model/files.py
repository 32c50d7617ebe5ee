"""Reading a model from a mesh file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.errors import MeshError
from picoradar.registration.model import cache
from picoradar.registration.model.prepared import Model, kept_model, prepare_model

SUFFIXES = (".stl", ".ply", ".obj", ".glb", ".vtp")


def load_model(path: str | os.PathLike[str]) -> Model:
    """Read and prepare a model; a file that was read before is known by its content and need not be parsed again.

    Parameters
    ----------
    path : path
        A ``.stl``, ``.ply``, ``.obj``, ``.glb`` or ``.vtp`` file, in millimetres.

    Raises
    ------
    MeshError
        Naming the file, what was found and what to do.

    Examples
    --------
    >>> import trimesh
    >>> from picoradar import load_model
    >>> _ = trimesh.creation.box((60, 50, 40)).export("block.stl")
    >>> model = load_model("block.stl")
    >>> model.name, model.closed
    ('block.stl', True)
    """
    file = Path(path)
    if file.suffix.lower() not in SUFFIXES:
        raise MeshError(f"{file}: a model is one of {' '.join(SUFFIXES)}, not '{file.suffix}'")
    if not file.is_file():
        raise MeshError(f"{file}: there is no such file; give the path of a mesh file")
    try:
        file_key = cache.key_of_file(file)
    except OSError as error:
        raise MeshError(f"{file}: cannot be read ({error}); check the path and your rights to it") from error
    key = cache.load_key(file_key)
    if key is not None and (kept := kept_model(key, file.name)) is not None:
        return kept
    vertices, faces = _read_vtp(file) if file.suffix.lower() == ".vtp" else _read_with_trimesh(file)
    try:
        model = prepare_model(vertices, faces, name=file.name)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from error
    if (
        cache.key_of_file(file) == file_key
    ):  # else it was written again meanwhile, and which of both was read is not known
        cache.store_key(file_key, model.key)
    return model


def _read_with_trimesh(file: Path) -> tuple[FloatArray, IntArray]:
    import trimesh

    if file.suffix.lower() == ".stl":
        _check_stl(file)
    try:
        loaded: Any = trimesh.load(file, process=False)
        mesh: Any = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except Exception as error:  # a reader may fail in any way on a damaged file; all mean the same here
        raise MeshError(f"{file}: cannot be read as a mesh ({error}); export it again") from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise MeshError(f"{file}: holds no triangles (a {type(mesh).__name__}); give a surface mesh")
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)


def _check_stl(file: Path) -> None:
    """Refuse an STL file that is neither text nor as long as its number of triangles says.

    Raises
    ------
    MeshError
        Which names what the header says and what the file holds.
    """
    size = file.stat().st_size
    with file.open("rb") as opened:
        head = opened.read(84)
    if size == 0 or head[:5].lower() == b"solid":
        return  # nothing, or text (a binary file may begin so, too): the reader tells
    stated = int.from_bytes(head[80:84], "little")
    if len(head) < 84 or size != 84 + 50 * stated:
        held = max(0, (size - 84) // 50)
        raise MeshError(
            f"{file}: no readable mesh: its header says {stated} triangles, the file has room for {held}; "
            "it is truncated or no STL; export it again"
        )


def _read_vtp(file: Path) -> tuple[FloatArray, IntArray]:
    from picoradar.registration.model.vtp import read_vtp

    return read_vtp(file)
