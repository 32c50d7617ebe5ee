"""`salvage`: what can still be read of a damaged recording, as a recording of its own."""

from __future__ import annotations

import os
import shutil
import sqlite3
import zlib
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from picoradar.instrument.recording.content import json_object, refuse_foreign_content
from picoradar.instrument.recording.database import create_database, refuse_missing
from picoradar.instrument.recording.errors import READING_ERRORS, RecordingError, from_sqlite, primary_code
from picoradar.instrument.recording.header import checked_header
from picoradar.instrument.recording.names import remove_with_companions
from picoradar.instrument.recording.recording import Recording
from picoradar.instrument.recording.registration_rows import (
    INSERT_REGISTRATION,
    REGISTRATION_TABLE,
    SELECT_ONE_REGISTRATION,
)
from picoradar.instrument.recording.zero_rows import INSERT_ZERO, SELECT_ONE_ZERO

TABLES = ("line", "wave", "window", "echo", "stretch")
HEADER_BYTES = 100  # of an SQLite file: page size at 16, pages at 28 (sqlite.org/fileformat.html, section 1.3)
LARGEST_CUT_BYTES = 10**11  # padding is sparse; more than this is no length but damage
DISK_FAILED = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY)
MAX_MISSED = 1000  # numbers of a table that cannot be read in a row, after which no more are looked for


def salvage(path: Path) -> tuple[Path, list[int], list[int]]:
    """Copy every line that reads and passes its check into a new recording beside the damaged one.

    The damaged file is not changed. The new one can be used as any other, and `picoradar resume` takes what it lacks.
    Lines whose raw samples do not read are kept without them.

    Parameters
    ----------
    path : Path
        A recording that was cut short or damaged; its header must read.

    Returns
    -------
    file : Path
        The new recording.
    kept, lost : list of int
        Lines that it has, and those that it lacks of the whole raster.

    Raises
    ------
    RecordingError
        When there is no such file, not even the header reads, or the new file is there already.
    """
    refuse_missing(path)
    new = path.with_name(f"{path.stem}-salvaged{path.suffix}")
    try:
        with TemporaryDirectory(dir=path.parent, prefix=".picoradar-") as folder:
            whole = Path(folder) / path.name
            _copy_padded(path, whole)
            address = f"{whole.resolve().as_uri()}?mode=rw"
            with closing(sqlite3.connect(address, uri=True, isolation_level=None)) as source:
                refuse_foreign_content(path, source)
                _copy(path, source, new)
    except OSError as error:
        remedy = "copy it to a folder that has room and that you may write to, and salvage it there"
        raise RecordingError(path, f"cannot be salvaged beside it ({error.strerror})", remedy) from error
    with Recording.resume(new) as salvaged:  # takes out what fails its check
        salvaged.event(0.0, "salvaged", source=path.name)
        return new, salvaged.done, salvaged.missing


def _copy(path: Path, source: sqlite3.Connection, new: Path) -> None:
    """Make the new recording; when it cannot be made to its end, none is left."""
    header = _header(path, source)
    rows = checked_header(json_object(path, header, "the header"))["raster"]["rows"]
    target = create_database(new, header)
    try:
        with closing(target):
            for row in range(rows):
                _copy_line(source, target, row)
            for event in _numbered(source, "SELECT id, t, kind, state, data FROM event WHERE id = ?"):
                target.execute("INSERT OR IGNORE INTO event (id, t, kind, state, data) VALUES (?, ?, ?, ?, ?)", event)
            for reading in _numbered(source, SELECT_ONE_ZERO):  # one that is damaged is no check
                with suppress(sqlite3.IntegrityError):
                    target.execute(INSERT_ZERO, reading)
            for registration in _numbered(source, SELECT_ONE_REGISTRATION):
                target.execute(REGISTRATION_TABLE)
                with suppress(sqlite3.IntegrityError):
                    target.execute(INSERT_REGISTRATION, registration)
    except BaseException as error:
        remove_with_companions(new)
        if isinstance(error, sqlite3.Error):
            raise from_sqlite(new, error) from error
        raise


def _copy_padded(path: Path, whole: Path) -> None:
    """Copy a file with what SQLite keeps beside it, and bring it to the length that its first page states.

    SQLite opens no file that is shorter; what is added is zeros, which no check sum passes.
    """
    for ending in ("", "-wal"):
        if Path(f"{path}{ending}").is_file():
            shutil.copyfile(f"{path}{ending}", f"{whole}{ending}")
    with whole.open("rb") as file:
        start = file.read(HEADER_BYTES)
    if len(start) < HEADER_BYTES or not start.startswith(b"SQLite format 3\0"):
        return
    page_bytes = int.from_bytes(start[16:18], "big")
    stated = (65536 if page_bytes == 1 else page_bytes) * int.from_bytes(start[28:32], "big")
    if whole.stat().st_size < stated <= whole.stat().st_size + LARGEST_CUT_BYTES:
        os.truncate(whole, stated)


def _header(path: Path, source: sqlite3.Connection) -> str:
    """Return the text of the header, or of its spare copy."""
    why = "its header is not there"
    for table in ("scan", "spare_header"):
        try:
            found = source.execute(f"SELECT header, header_crc32 FROM {table}").fetchone()
        except READING_ERRORS as error:
            why = str(error)
            continue
        if found is not None and isinstance(found[0], str) and zlib.crc32(found[0].encode()) == found[1]:
            return str(found[0])
    raise RecordingError(path, f"nothing can be salvaged: {why}", "restore it from a copy")


def _copy_line(source: sqlite3.Connection, target: sqlite3.Connection, row: int) -> None:
    """Copy a line, and its raw samples where they read."""
    for table in TABLES:
        found = None
        with suppress(*READING_ERRORS):
            found = source.execute(f"SELECT * FROM {table} WHERE k = ?", (row,)).fetchone()
        if found is None:
            continue
        try:  # the raw samples of a line that does not read are refused: they refer to it
            target.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(found))})", found)
        except sqlite3.Error as error:
            if primary_code(error) in DISK_FAILED:  # that is no loss of the damaged file
                raise


def _numbered(source: sqlite3.Connection, query: str) -> Iterator[Any]:
    """Read the rows of a table that are numbered from 1, as far as they read."""
    number = missed = 0
    while missed < MAX_MISSED:
        number += 1
        found = None
        with suppress(*READING_ERRORS):
            found = source.execute(query, (number,)).fetchone()
        missed = 0 if found is not None else missed + 1
        if found is not None:
            yield found
