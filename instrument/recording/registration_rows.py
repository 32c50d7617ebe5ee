"""The table ``registration``: what was registered from a recording while it was made, with a digest of each row.

The table is made when it is first needed; a recording without one was never registered.
"""

from __future__ import annotations

import hashlib
import sqlite3
from pathlib import Path

from picoradar.instrument.events import JsonObject
from picoradar.instrument.recording.content import FROM_A_COPY, json_object
from picoradar.instrument.recording.errors import RecordingError
from picoradar.instrument.recording.header import canonical

REGISTRATION_TABLE = """
CREATE TABLE IF NOT EXISTS registration (
    id INTEGER PRIMARY KEY,
    lines INTEGER NOT NULL,
    content TEXT NOT NULL,
    sha256 TEXT NOT NULL
)
"""
HAS_TABLE = "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = 'registration'"
SELECT_REGISTRATIONS = "SELECT lines, content, sha256 FROM registration ORDER BY id LIMIT 10000"
SELECT_ONE_REGISTRATION = "SELECT id, lines, content, sha256 FROM registration WHERE id = ?"
INSERT_REGISTRATION = "INSERT INTO registration (id, lines, content, sha256) VALUES (?, ?, ?, ?)"
_APPEND = "INSERT INTO registration (lines, content, sha256) VALUES (?, ?, ?)"


def append_row(connection: sqlite3.Connection, content: JsonObject, lines: int) -> None:
    """Write a registration within a transaction; ``lines`` are those that the recording holds.

    Raises
    ------
    ValueError
        If something in it has no JSON form.
    sqlite3.Error
    """
    text = canonical(content)
    connection.execute(REGISTRATION_TABLE)
    connection.execute(_APPEND, (lines, text, _digest(lines, text)))


def registration_of(path: Path, row: tuple[object, ...]) -> JsonObject:
    """Return the content of a row, joined by the digest and how many lines the recording held.

    Raises
    ------
    RecordingError
        If it is damaged.
    """
    lines, text, sha256 = row
    if not isinstance(lines, int) or not isinstance(text, str) or sha256 != _digest(lines, text):
        raise RecordingError(path, "the digest of a registration does not fit", FROM_A_COPY)
    return {**json_object(path, text, "a registration"), "lines_recorded": lines, "sha256": sha256}


def _digest(lines: int, text: str) -> str:
    return hashlib.sha256(f"{lines}\n{text}".encode()).hexdigest()
