"""Prepared models on disk, by digest of their content: safe to delete at any time.

One file a model, ``registration-v<version>-<digest>.npz``, in the folder named by the environment variable
``PICORADAR_CACHE``, else in the user's cache folder of the platform. A file is written under another name and then
renamed, so that readers never see half of it; one that cannot be read is made anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from registration._types import FloatArray, IntArray
from registration.field import DistanceField
from registration.mesh import MeshReport
from registration.views import View

VERSION = 4
"""Raised whenever preparation or the file's layout changes."""

Prepared = tuple[FloatArray, IntArray, MeshReport, tuple[View, ...]]

T = TypeVar("T")


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


def load_view(key: str) -> View | None:
    """Read a single view; None when it is not there or cannot be read."""
    return _read(key, lambda stored: _view(stored, 0))


def _read(key: str, taken: Callable[[Mapping[str, Any]], T]) -> T | None:
    try:
        with _path(key).open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return taken(stored)
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None  # absent, or a damaged or foreign file: the caller prepares anew and replaces it


def _prepared(stored: Mapping[str, Any]) -> Prepared:
    header = json.loads(str(stored["header"]))
    views = tuple(_view(stored, index) for index in range(header["views"]))
    return stored["vertices"], stored["faces"], _report(header["report"]), views


def store(key: str, prepared: Prepared) -> None:
    """Write a prepared model; a folder that cannot be written to costs a warning and no more."""
    vertices, faces, report, views = prepared
    header = json.dumps({"report": asdict(report), "views": len(views)})
    _write(key, {"header": np.array(header), "vertices": vertices, "faces": faces, **_arrays(views)})


def store_view(key: str, view: View) -> None:
    """Write a single view, as :func:`store` does a model."""
    _write(key, _arrays((view,)))


def _arrays(views: tuple[View, ...]) -> dict[str, npt.NDArray[Any]]:
    arrays: dict[str, npt.NDArray[Any]] = {}
    for index, view in enumerate(views):
        arrays[f"place{index}"] = np.concatenate([view.centre, [view.radius_mm], view.axis, [view.whole]])
        for name, field in (("fine", view.fine), ("coarse", view.coarse)):
            arrays[f"{name}{index}"] = field.nodes
            arrays[f"{name}_grid{index}"] = np.concatenate([field.low, [field.step_mm], field.shape])
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


def _view(stored: Mapping[str, Any], index: int) -> View:
    place = stored[f"place{index}"]
    fields = []
    for name in ("fine", "coarse"):
        grid = stored[f"{name}_grid{index}"]
        shape = (int(grid[4]), int(grid[5]), int(grid[6]))
        nodes = stored[f"{name}{index}"]
        if nodes.shape != (shape[0] * shape[1] * shape[2], 4):
            raise ValueError(f"field {name} has {nodes.shape} nodes for a grid of {shape}")
        fields.append(DistanceField(low=grid[:3], step_mm=float(grid[3]), shape=shape, nodes=nodes))
    return View(place[:3], float(place[3]), place[4:7], fields[0], fields[1], whole=bool(place[7]))
