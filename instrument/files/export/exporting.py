"""`export`: a recording as a file for other programs."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypedDict, TypeVar

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.about import texts_of
from picoradar.instrument.files.export.csv import holds_csv, write_csv
from picoradar.instrument.files.export.errors import ExportError
from picoradar.instrument.files.export.hdf5 import holds_h5, write_h5
from picoradar.instrument.files.export.las import holds_las, return_rows, write_las
from picoradar.instrument.files.export.npz import arrays_of, holds_npz, write_npz
from picoradar.instrument.files.export.ply import holds_ply, write_ply
from picoradar.instrument.files.export.safely import write_safely
from picoradar.instrument.files.export.table import TableFile, point_rows
from picoradar.instrument.files.export.tree import Tree
from picoradar.instrument.files.export.zarr_folder import holds_zarr, write_zarr
from picoradar.instrument.recording import Cloud, Recording

T = TypeVar("T")
Save = Callable[[Path, "Content"], None]


class Exported(TypedDict):
    """Path of the written file as text, the number of places with a range, and of those of them with two echoes."""

    written: str
    points: int
    two_echoes: int


def export(
    recording: Recording,
    path: str | os.PathLike[str],
    *,
    waveforms: bool = False,
    zero_check: Mapping[str, object] | None = None,
) -> Exported:
    """Write the points of a recording; the ending of the name chooses the format.

    A place with two echoes is one point, that of the first, with the last one in columns of its own; in LAS each echo
    is a return of its own. The range error that all points share goes along, so that a registration can be told.

    The file is written under a temporary name, synced, read back and compared, and only then put in place. Points
    without a range are left out. The same recording gives the same bytes.

    Parameters
    ----------
    recording : Recording
        Read whole; a damaged line stops the export.
    path : path
        Name with one of the endings of `FORMATS`. An older file there is replaced; a recording never is.
    waveforms : bool
        Write the raw traces too, where the format has a place for them.
    zero_check : mapping, optional
        What the check of the range zero has found (`ZeroCheck.to_dict`), to go along: without it, a registration of the
        file cannot pass.

    Returns
    -------
    Exported

    Raises
    ------
    ExportError
        If the ending is not known, the format holds no traces, or the file cannot be written.
    RecordingError
        If a line of the recording is damaged.
    """
    file = Path(path)
    chosen = FORMATS.get(file.suffix.lower())
    if chosen is None:
        raise ExportError(f"{file}: the ending '{file.suffix}' is not known; use one of {' '.join(FORMATS)}")
    if file.exists() and file.samefile(recording.path):
        raise ExportError(f"{file}: is the recording itself; give another name")
    save = chosen.save_with_traces if waveforms else chosen.save
    if save is None:
        able = " or ".join(suffix for suffix, entry in FORMATS.items() if entry.save_with_traces is not None)
        raise ExportError(f"{file}: {file.suffix} has no place for traces; use {able}")
    cloud = recording.cloud()
    points = cloud.with_range()
    save(file, Content(points, recording, texts_of(recording, cloud, zero_check)))
    return {"written": str(file), "points": len(points), "two_echoes": int(points.two_echoes.sum())}


@dataclass(frozen=True)
class Content:
    """What is exported: the points with a range, the recording that they are of, and what is said about them."""

    points: Cloud
    recording: Recording
    about: dict[str, str]


@dataclass(frozen=True)
class Format:
    """How a recording is saved in one format, and with its traces where the format has a place for them."""

    save: Save
    save_with_traces: Save | None = None


def _saver(made_of: Callable[[Content], T], write: Callable[[Path, T], None], holds: Callable[[Path, T], bool]) -> Save:
    """Make the function that writes what is made of the content safely and proves that the file holds it."""

    def save(file: Path, content: Content) -> None:
        made = made_of(content)
        write_safely(file, lambda name: write(name, made), lambda name: holds(name, made))

    return save


def _table(content: Content) -> TableFile:
    return TableFile(point_rows(content.points), content.about)


def _archive(content: Content) -> dict[str, NDArray[np.generic]]:
    return arrays_of(content.points) | {name: np.array(text) for name, text in content.about.items()}


def _returns(content: Content) -> TableFile:
    return TableFile(return_rows(content.points), content.about)


def _tree(content: Content) -> Tree:
    return Tree(arrays_of(content.points), content.recording, content.about, traces=False)


def _tree_with_traces(content: Content) -> Tree:
    return replace(_tree(content), traces=True)


FORMATS: dict[str, Format] = {
    ".ply": Format(_saver(_table, write_ply, holds_ply)),
    ".csv": Format(_saver(_table, write_csv, holds_csv)),
    ".npz": Format(_saver(_archive, write_npz, holds_npz)),
    ".las": Format(_saver(_returns, write_las, holds_las)),
    ".h5": Format(_saver(_tree, write_h5, holds_h5), _saver(_tree_with_traces, write_h5, holds_h5)),
    ".zarr": Format(_saver(_tree, write_zarr, holds_zarr), _saver(_tree_with_traces, write_zarr, holds_zarr)),
}
