"""Write a file completely or not at all: private folder beside it, fsync, read back, rename.

Points of a patient are as private as the recording that they come from: files of mode 0600, folders of 0700, whatever
the umask says (docs/files.md). They are written in a folder that nobody else can enter, so that this holds throughout.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable
from pathlib import Path

from picoradar.instrument.files.export.errors import ExportError

PRIVATE_FILE, PRIVATE_FOLDER = 0o600, 0o700
"""Modes (POSIX) of what holds points of a patient: its owner alone."""


def write_safely(path: Path, write: Callable[[Path], None], holds: Callable[[Path], bool]) -> None:
    """Put a file (or a folder, for formats that are folders) in place once it has been read back.

    Parameters
    ----------
    path : Path
        Its final path; an older file there is replaced at the very end.
    write : callable
        Writes to the temporary path given.
    holds : callable
        Reads the temporary path back and returns whether it holds what was written.

    Raises
    ------
    ExportError
        If the folder does not exist, the disk refuses, or the file reads back differently; what was at `path` before
        is then still there.
    """
    if not path.parent.is_dir():
        raise ExportError(f"{path}: there is no folder {path.parent}; make it first")
    if path.is_dir() and not (path / "zarr.json").is_file():
        raise ExportError(f"{path}: is a folder; give the name of a file")
    folder = path.with_name(f".{path.stem}.{secrets.token_hex(4)}")
    temporary = folder / path.name
    try:
        folder.mkdir(mode=PRIVATE_FOLDER)
        write(temporary)
        _make_private(temporary)
        _sync(temporary)
        if not _reads_back(holds, temporary):
            raise ExportError(
                f"{path}: reads back differently from what was written; nothing was changed; check the disk"
            )
        if path.is_dir():
            shutil.rmtree(path)
        os.replace(temporary, path)
        _sync_entry(path.parent)
    except OSError as error:
        raise ExportError(f"{path}: cannot be written ({error.strerror or error}); nothing was changed") from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _make_private(path: Path) -> None:
    for entry in [path, *path.rglob("*")] if path.is_dir() else [path]:
        entry.chmod(PRIVATE_FOLDER if entry.is_dir() else PRIVATE_FILE)


def _reads_back(holds: Callable[[Path], bool], temporary: Path) -> bool:
    try:
        return holds(temporary)
    except ValueError:  # what every reader raises for a file that it cannot read
        return False


def _sync(path: Path) -> None:
    for entry in [path, *path.rglob("*")] if path.is_dir() else [path]:
        _sync_entry(entry)


def _sync_entry(path: Path) -> None:
    if path.is_dir() and os.name == "nt":
        return  # folders cannot be synced there, and need not be
    handle = os.open(path, os.O_RDONLY if os.name != "nt" else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
