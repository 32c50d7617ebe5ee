"""Prepared models on disk, by digest of their content: safe to delete at any time.

In the folder named by the environment variable ``PICORADAR_CACHE``, else in the user's cache folder of the platform,
lies ``registration-v<version>-<digest>.npz`` for each model, with the mesh and the fields of its likeliest view; one
more for the fields of any other view that was ever needed; and a small one for each mesh file that was read, with the
digest of the mesh in it. A file is written under another name and then renamed, so that readers never see half of it;
one that cannot be read is prepared again.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.errors import DECODER_ERRORS
from picoradar.registration.model.field import DistanceField
from picoradar.registration.model.mesh import MeshReport
from picoradar.registration.model.views import Fields

VERSION = 9
"""Raised whenever the reading of mesh files, their preparation or the layout here changes."""

HollowPlace = tuple[FloatArray, float, FloatArray, bool]
"""Centre (3,) mm, radius (mm), axis (3,) of a view, and whether it is the whole model."""

T = TypeVar("T")


@dataclass(frozen=True)
class Prepared:
    """What is kept of a model: its mesh, what validation found, where its views are, and the fields of the first."""

    vertices: FloatArray
    faces: IntArray
    report: MeshReport
    places: tuple[HollowPlace, ...]
    fields: Fields

    def likeliest(self) -> Fields:
        """Fields of the first view, for :class:`picoradar.registration.model.views.View` to fetch."""
        return self.fields


def folder() -> Path:
    """The cache folder; it need not exist."""
    named = os.environ.get("PICORADAR_CACHE")
    if named:
        return Path(named)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "picoradar"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "picoradar"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "picoradar"


def digest(vertices: npt.NDArray[Any], faces: npt.NDArray[Any]) -> str:
    """Digest of a mesh as it was given."""
    content = hashlib.sha256()
    for array in (vertices, faces):
        content.update(f"{array.dtype.str}{array.shape}".encode())
        content.update(np.ascontiguousarray(array).data)
    return content.hexdigest()


def load(key: str) -> Prepared | None:
    """Read a prepared model; None when it is not there or cannot be read."""
    return _read(key, _prepared)


def key_of_file(suffix: str, content: bytes) -> str:
    """Digest of a mesh file: of its ending and of what it holds."""
    found = hashlib.sha256(suffix.lower().encode())
    found.update(content)
    return f"file-{found.hexdigest()}"


def load_key(file_key: str) -> str | None:
    """Key of the mesh that such a file held when it was last read; None when that is not known."""
    return _read(file_key, lambda stored: str(stored["mesh"]))


def store_key(file_key: str, key: str) -> None:
    """Remember which mesh a file holds, so that it need not be parsed again."""
    _write(file_key, {"mesh": np.array(key)})


def kept_fields(name: str, make: Callable[[], Fields]) -> Fields:
    """Read the fields that are kept under a name; where there are none, make them and keep them."""
    return _kept(name, _fields, make, _field_arrays)


def kept_array(name: str, make: Callable[[], FloatArray]) -> FloatArray:
    """The same for a single array."""
    return _kept(name, lambda stored: np.asarray(stored["values"], np.float64), make, lambda found: {"values": found})


def _kept(
    name: str,
    taken: Callable[[Mapping[str, Any]], T],
    make: Callable[[], T],
    arrays: Callable[[T], dict[str, npt.NDArray[Any]]],
) -> T:
    found = _read(name, taken)
    if found is None:
        found = make()
        _write(name, arrays(found))
    return found


def _read(key: str, taken: Callable[[Mapping[str, Any]], T]) -> T | None:
    try:
        with zipfile.ZipFile(_path(key)) as stored:
            return taken({Path(name).stem: _array(stored.read(name)) for name in stored.namelist()})
    except OSError:
        return None  # not there
    except DECODER_ERRORS:
        return None  # a damaged or foreign file: the caller prepares it again and replaces it


def _array(member: bytes) -> npt.NDArray[Any]:
    """The array in a member of the file: read whole, so that its check sum was compared, the header included."""
    opened = io.BytesIO(member)
    if np.lib.format.read_magic(opened) != (1, 0):
        raise ValueError("another version of the format")
    shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(opened)
    if fortran_order or dtype.hasobject:
        raise ValueError("an array that is not laid out as written here")
    return np.frombuffer(member, dtype, math.prod(shape), opened.tell()).reshape(shape)


def _prepared(stored: Mapping[str, Any]) -> Prepared:
    vertices, faces, rows = stored["vertices"], stored["faces"], stored["places"]
    places = tuple((row[:3], float(row[3]), row[4:7], bool(row[7])) for row in rows)
    return Prepared(vertices, faces, _report(json.loads(str(stored["report"]))), places, _fields(stored))


def store(key: str, prepared: Prepared) -> None:
    """Write a prepared model; a folder that cannot be written to costs a warning and no more."""
    places = np.array([[*centre, radius, *axis, whole] for centre, radius, axis, whole in prepared.places])
    report = np.array(json.dumps(asdict(prepared.report)))
    mesh = {"vertices": prepared.vertices, "faces": prepared.faces}
    _write(key, {"report": report, "places": places, **mesh, **_field_arrays(prepared.fields)})


def _field_arrays(fields: Fields) -> dict[str, npt.NDArray[Any]]:
    arrays: dict[str, npt.NDArray[Any]] = {}
    for name, field in zip(("fine", "coarse"), fields, strict=True):
        arrays[name] = field.nodes
        arrays[f"{name}_grid"] = np.concatenate([field.low, [field.step_mm], field.shape])
    return arrays


def _write(key: str, arrays: dict[str, npt.NDArray[Any]]) -> None:
    path = _path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as part:
            try:
                np.savez(part, allow_pickle=False, **arrays)
                part.close()
                os.replace(part.name, path)
            except BaseException:  # a full disk, or Ctrl-C: what is half written would lie there for ever
                os.unlink(part.name)
                raise
    except OSError as error:
        warnings.warn(f"the prepared model could not be kept in {path.parent} ({error})", RuntimeWarning, stacklevel=4)


def _path(key: str) -> Path:
    return folder() / f"registration-v{VERSION}-{key}.npz"


def _report(values: dict[str, Any]) -> MeshReport:
    values["extent_mm"] = tuple(values["extent_mm"])
    values["findings"] = tuple(values["findings"])
    return MeshReport(**values)


def _fields(stored: Mapping[str, Any]) -> Fields:
    return _field(stored, "fine"), _field(stored, "coarse")


def _field(stored: Mapping[str, Any], name: str) -> DistanceField:
    grid, nodes = stored[f"{name}_grid"], stored[name]
    shape = (int(grid[4]), int(grid[5]), int(grid[6]))
    if nodes.shape != (shape[0] * shape[1] * shape[2], 4):
        raise ValueError(f"field {name} has {nodes.shape} nodes for a grid of {shape}")
    return DistanceField(low=grid[:3], step_mm=float(grid[3]), shape=shape, nodes=nodes)
