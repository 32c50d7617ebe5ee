"""`export`: a recording as a file for other programs."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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


def export(recording: Recording, path: str | os.PathLike[str], waveforms: bool = False) -> dict[str, Any]:
    """Write the points of a recording; the ending of the name chooses the format.

    The file is written under a temporary name, synced, read back and compared, and only then put in place. Places
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
    dict
        ``written`` (path as text) and ``points`` (their number).

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
    if waveforms and not chosen.takes_traces:
        able = " or ".join(suffix for suffix, entry in FORMATS.items() if entry.takes_traces)
        raise ExportError(f"{file}: {file.suffix} has no place for traces; use {able}")
    cloud = recording.cloud()
    content = chosen.content(cloud, recording, waveforms)
    write_safely(file, lambda name: chosen.write(name, content), lambda name: chosen.holds(name, content))
    return {"written": str(file), "points": int(cloud.has_range.sum())}


@dataclass(frozen=True)
class Format:
    """How a format is written and proven; `content` makes what both take."""

    content: Callable[[Cloud, Recording, bool], Any]
    write: Callable[[Path, Any], None]
    holds: Callable[[Path, Any], bool]
    takes_traces: bool = False


def _table(cloud: Cloud, _recording: Recording, _waveforms: bool) -> Any:
    return point_rows(cloud)


def _arrays(cloud: Cloud, _recording: Recording, _waveforms: bool) -> Any:
    return arrays_of(cloud)


def _tree(cloud: Cloud, recording: Recording, waveforms: bool) -> Any:
    return Tree(arrays_of(cloud), recording, waveforms)


FORMATS: dict[str, Format] = {
    ".ply": Format(_table, write_ply, holds_ply),
    ".csv": Format(_table, write_csv, holds_csv),
    ".npz": Format(_arrays, write_npz, holds_npz),
    ".las": Format(_table, write_las, holds_las),
    ".h5": Format(_tree, write_h5, holds_h5, takes_traces=True),
    ".zarr": Format(_tree, write_zarr, holds_zarr, takes_traces=True),
}
