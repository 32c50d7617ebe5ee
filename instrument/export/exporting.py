"""`export`: a recording as a file for other programs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from instrument.export.csv import holds_csv, write_csv
from instrument.export.errors import ExportError
from instrument.export.npz import arrays_of, holds_npz, write_npz
from instrument.export.ply import holds_ply, write_ply
from instrument.export.safely import write_safely
from instrument.export.table import point_rows
from instrument.recording import Cloud, Recording


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
    write = FORMATS.get(file.suffix.lower())
    if write is None:
        raise ExportError(f"{file}: the ending '{file.suffix}' is not known; use one of {' '.join(FORMATS)}")
    if file.exists() and file.samefile(recording.path):
        raise ExportError(f"{file}: is the recording itself; give another name")
    if waveforms:
        raise ExportError(f"{file}: {file.suffix} has no place for traces")
    cloud = recording.cloud()
    write(cloud, file)
    return {"written": str(file), "points": int(cloud.has_range.sum())}


def _ply(cloud: Cloud, path: Path) -> None:
    table = point_rows(cloud)
    write_safely(path, lambda file: write_ply(file, table), lambda file: holds_ply(file, table))


def _csv(cloud: Cloud, path: Path) -> None:
    table = point_rows(cloud)
    write_safely(path, lambda file: write_csv(file, table), lambda file: holds_csv(file, table))


def _npz(cloud: Cloud, path: Path) -> None:
    arrays = arrays_of(cloud)
    write_safely(path, lambda file: write_npz(file, arrays), lambda file: holds_npz(file, arrays))


FORMATS: dict[str, Callable[[Cloud, Path], None]] = {".ply": _ply, ".csv": _csv, ".npz": _npz}
