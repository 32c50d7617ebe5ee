"""Refusals of the recording: which file, which line, what is kept, what to do."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from picoradar.instrument.errors import PicoradarError

SALVAGE = "restore it from a copy, or get what still reads with `picoradar info --salvage`"
_WORDS = {
    sqlite3.SQLITE_FULL: "the disk is full",
    sqlite3.SQLITE_READONLY: "the file or its folder is read-only",
    sqlite3.SQLITE_IOERR: "the disk reports an input/output error",
    sqlite3.SQLITE_CORRUPT: "the file is damaged",
    sqlite3.SQLITE_NOTADB: "this is no recording",
    sqlite3.SQLITE_CANTOPEN: "the file cannot be opened",
    sqlite3.SQLITE_BUSY: "another program is writing to the file",
    sqlite3.SQLITE_LOCKED: "another program is writing to the file",
    sqlite3.SQLITE_PERM: "permission denied",
    sqlite3.SQLITE_TOOBIG: "the line is too large for one row",
}
_REMEDY = {
    sqlite3.SQLITE_FULL: "make room, then go on with `picoradar resume`",
    sqlite3.SQLITE_READONLY: "write to a folder that you may write to",
    sqlite3.SQLITE_IOERR: "check the disk before you go on; copy the file to a sound one",
    sqlite3.SQLITE_CORRUPT: SALVAGE,
    sqlite3.SQLITE_NOTADB: "give a file that `picoradar scan` has written",
    sqlite3.SQLITE_CANTOPEN: "check the folder and its permissions",
    sqlite3.SQLITE_BUSY: "end the other program first",
    sqlite3.SQLITE_LOCKED: "end the other program first",
}

READING_ERRORS: tuple[type[sqlite3.Error] | type[UnicodeDecodeError], ...] = (sqlite3.Error, UnicodeDecodeError)
"""What reading a database may raise; the second where SQLite's own message quotes damaged bytes of the file."""


class RecordingError(PicoradarError):
    """A recording cannot be written or read.

    Parameters
    ----------
    file : path
        The recording.
    what : str
        What happened.
    remedy : str, optional
        What a person can do about it.
    line : int, optional
        Row of the raster that is concerned.
    kept : int, optional
        Number of lines that are safe on the disk.
    """

    exit_status = 2

    def __init__(
        self, file: Path, what: str, remedy: str = "", *, line: int | None = None, kept: int | None = None
    ) -> None:
        self.file = file
        self.what = what
        self.remedy = remedy
        self.line = line
        self.kept = kept
        where = str(file) if line is None else f"{file}, line {line}"
        safe = "" if kept is None else f"; {kept} lines are safe on the disk"
        super().__init__(f"{where}: {what}{safe}" + (f" ({remedy})" if remedy else ""))


def primary_code(error: Exception) -> int:
    """Return SQLite's primary result code; an error of the operating system counts as input/output error."""
    if isinstance(error, UnicodeDecodeError):
        return sqlite3.SQLITE_CORRUPT
    if isinstance(error, OSError):
        return sqlite3.SQLITE_IOERR
    code: int = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)
    return code & 0xFF


def from_sqlite(file: Path, error: Exception, *, line: int | None = None, kept: int | None = None) -> RecordingError:
    """Put an error of SQLite into the words of the recording, with SQLite's own text."""
    code = primary_code(error)
    words = _WORDS.get(code)
    what = f"{words} ({error})" if words else f"cannot be used ({error})"
    return RecordingError(file, what, _REMEDY.get(code, ""), line=line, kept=kept)
