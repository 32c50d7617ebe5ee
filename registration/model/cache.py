"""Prepared models on disk, by digest of their content: safe to delete at any time.

In the folder named by the environment variable ``PICORADAR_CACHE``, else in the user's cache folder of the platform,
lies ``registration-v<version>-<digest>.npz`` for each model, with the mesh and the fields of its likeliest view; one
more for the fields of any other view that was ever needed; and a small one for each mesh file that was read, with the
digest of the mesh in it. A file is written under another name and then renamed, so that readers never see half of it.
Each one carries a seal over its key and its content: one that is damaged, or that lies under the key of another model,
is prepared again, and so is one that somebody else could have written. What was not used for longest is removed
(`cache_folder`).
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
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
from picoradar.registration.model.cache_folder import evict, opened_own, path_of
from picoradar.registration.model.field import DistanceField
from picoradar.registration.model.mesh import MeshReport
from picoradar.registration.model.views import Fields

HollowPlace = tuple[FloatArray, float, FloatArray, bool]
"""Centre (3,) mm, radius (mm), axis (3,) of a view, and whether it is the whole model."""

SEAL = "seal"
"""Member of a file with the digest of `_seal`."""

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


def digest(*arrays: npt.NDArray[Any]) -> str:
    """Digest of arrays: vertices and faces of a mesh as it was given."""
    content = hashlib.sha256()
    for array in arrays:
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
        with opened_own(path_of(key)) as file, zipfile.ZipFile(file) as stored:
            if any(member.compress_type != zipfile.ZIP_STORED for member in stored.infolist()):
                raise ValueError("compressed, as nothing here is written")
            seal = stored.read(SEAL).decode()
            arrays = {Path(name).stem: _array(stored.read(name)) for name in stored.namelist() if name != SEAL}
            if seal != _seal(key, stored, arrays):
                raise ValueError("the file of another model, or its content was changed")
        return taken(arrays)
    except OSError:
        return None  # not there
    except DECODER_ERRORS:
        return None  # a damaged or foreign file: the caller prepares it again and replaces it


def _seal(key: str, stored: zipfile.ZipFile, arrays: Mapping[str, npt.NDArray[Any]]) -> str:
    """Digest that ties what is in a file to the key that it lies under: each member, and the mesh by its own digest.

    The fields, megabytes, go in by their check sums, which zipfile compares anyhow: a hit stays fast.
    """
    content = hashlib.sha256(key.encode())
    for member in sorted(stored.infolist(), key=lambda member: member.filename):
        if member.filename != SEAL:
            content.update(f"{member.filename} {member.file_size} {member.CRC} ".encode())
    content.update(digest(*(arrays[name] for name in ("vertices", "faces") if name in arrays)).encode())
    return content.hexdigest()


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
    path = path_of(key)
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix="registration-", suffix=".part", delete=False) as part:
            try:
                np.savez(part, allow_pickle=False, **arrays)
                with zipfile.ZipFile(part, "a") as made:
                    made.writestr(SEAL, _seal(key, made, arrays))
                part.close()
                os.replace(part.name, path)
            except BaseException:  # a full disk, or Ctrl-C: what is half written would lie there for ever
                os.unlink(part.name)
                raise
        evict(path)
    except OSError as error:
        warnings.warn(f"the prepared model could not be kept in {path.parent} ({error})", RuntimeWarning, stacklevel=4)


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
