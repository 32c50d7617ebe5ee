"""Reading a model from a mesh file."""

from __future__ import annotations

import os
from pathlib import Path

from picoradar.registration.errors import MeshError
from picoradar.registration.model import cache
from picoradar.registration.model.limits import LARGEST_FILE_BYTES
from picoradar.registration.model.prepared import Model, kept_model, prepare_model
from picoradar.registration.model.reading import read_mesh

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
    content = _content(file)
    file_key = cache.key_of_file(file.suffix, content)
    key = cache.load_key(file_key)
    if key is not None and (kept := kept_model(key, file.name)) is not None:
        return kept
    vertices, faces = read_mesh(file, content)
    try:
        model = prepare_model(vertices, faces, name=file.name)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from error
    except MemoryError as error:
        raise MeshError(f"{file}: its preparation needs more memory than there is; simplify the surface") from error
    cache.store_key(file_key, model.key)
    return model


def _content(file: Path) -> bytes:
    """Read the file once, so that what is parsed is what is known by its digest."""
    try:
        with file.open("rb") as opened:
            content = opened.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise MeshError(f"{file}: cannot be read ({error}); check the path and your rights to it") from error
    if len(content) > LARGEST_FILE_BYTES:
        raise MeshError(f"{file}: is larger than {LARGEST_FILE_BYTES} bytes; simplify the surface")
    return content
