"""`export`: a recording as a file for other programs."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict, TypeVar

from picoradar.instrument.files.export.csv import holds_csv, write_csv
from picoradar.instrument.files.export.errors import ExportError
from picoradar.instrument.files.export.hdf5 import holds_h5, write_h5
from picoradar.instrument.files.export.las import holds_las, write_las
from picoradar.instrument.files.export.npz import arrays_of, holds_npz, write_npz
from picoradar.instrument.files.export.ply import holds_ply, write_ply
from picoradar.instrument.files.export.safely import write_safely
from picoradar.instrument.files.export.table import point_rows
from picoradar.instrument.files.export.tree import Tree
from picoradar.instrument.files.export.zarr_folder import holds_zarr, write_zarr
from picoradar.instrument.recording import Cloud, Recording

T = TypeVar("T")
Save = Callable[[Path, Cloud, Recording], None]


class Exported(TypedDict):
    """Path of the written file as text, and the number of its points."""

    written: str
    points: int


def export(recording: Recording, path: str | os.PathLike[str], *, waveforms: bool = False) -> Exported:
    """Write the points of a recording; the ending of the name chooses the format.

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
    save(file, cloud, recording)
    return {"written": str(file), "points": int(cloud.has_range.sum())}


@dataclass(frozen=True)
class Format:
    """How a recording is saved in one format, and with its traces where the format has a place for them."""

    save: Save
    save_with_traces: Save | None = None


def _saver(
    content: Callable[[Cloud, Recording], T], write: Callable[[Path, T], None], holds: Callable[[Path, T], bool]
) -> Save:
    """Make the function that writes ``content`` safely and proves that the file holds it."""

    def save(file: Path, cloud: Cloud, recording: Recording) -> None:
        made = content(cloud, recording)
        write_safely(file, lambda name: write(name, made), lambda name: holds(name, made))

    return save


def _tree(cloud: Cloud, recording: Recording) -> Tree:
    return Tree(arrays_of(cloud), recording, traces=False)


def _tree_with_traces(cloud: Cloud, recording: Recording) -> Tree:
    return Tree(arrays_of(cloud), recording, traces=True)


FORMATS: dict[str, Format] = {
    ".ply": Format(_saver(lambda cloud, _: point_rows(cloud), write_ply, holds_ply)),
    ".csv": Format(_saver(lambda cloud, _: point_rows(cloud), write_csv, holds_csv)),
    ".npz": Format(_saver(lambda cloud, _: arrays_of(cloud), write_npz, holds_npz)),
    ".las": Format(_saver(lambda cloud, _: point_rows(cloud), write_las, holds_las)),
    ".h5": Format(_saver(_tree, write_h5, holds_h5), _saver(_tree_with_traces, write_h5, holds_h5)),
    ".zarr": Format(_saver(_tree, write_zarr, holds_zarr), _saver(_tree_with_traces, write_zarr, holds_zarr)),
}
