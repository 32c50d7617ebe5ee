"""What the tables of a recording may hold, whoever made the file: only its own tables, text, JSON of the right form."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from picoradar.drivers.errors import parse_json
from picoradar.instrument.events import JsonObject
from picoradar.instrument.recording.errors import READING_ERRORS, RecordingError, from_sqlite
from picoradar.instrument.recording.findings import Event
from picoradar.instrument.recording.limits import LARGEST_VALUE_BYTES, TABLES

FROM_A_COPY = "restore it from a copy"

_FOREIGN = f"""
SELECT name FROM sqlite_schema WHERE name NOT LIKE 'sqlite~_%' ESCAPE '~'
AND (type != 'table' OR sql LIKE 'CREATE VIRTUAL%' OR name NOT IN ({",".join("?" * len(TABLES))}))
"""


def refuse_foreign_content(path: Path, connection: sqlite3.Connection) -> None:
    """Refuse what is more than a recording's tables; from now on no value may be larger than `LARGEST_VALUE_BYTES`.

    A view in place of a table would compute its rows when they are read: of any size, without end.

    Raises
    ------
    RecordingError
    """
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_VALUE_BYTES)
    try:
        foreign = connection.execute(_FOREIGN, sorted(TABLES)).fetchone()
    except READING_ERRORS as error:
        raise from_sqlite(path, error) from error
    if foreign is not None:
        raise RecordingError(path, f"has {str(foreign[0])[:60]!r}, which no recording has", FROM_A_COPY)


def json_object(path: Path, text: object, what: str) -> JsonObject:
    """Read a JSON object out of a field.

    Parameters
    ----------
    path : Path
    text : object
        The field.
    what : str
        Its name for the message.

    Raises
    ------
    RecordingError
    """
    if not isinstance(text, str):
        raise RecordingError(path, f"{what} is no text", FROM_A_COPY)
    try:
        content = parse_json(text)
    except ValueError as error:
        raise RecordingError(path, f"{what} is damaged ({error})", FROM_A_COPY) from error
    if not isinstance(content, dict):
        raise RecordingError(path, f"{what} is damaged", FROM_A_COPY)
    return content


def event_of(path: Path, row: tuple[object, ...]) -> Event:
    """Make an event of its row: t, kind, state, data.

    Raises
    ------
    RecordingError
    """
    time_s, kind, state, data = row
    if not (isinstance(time_s, float | int) and isinstance(kind, str) and isinstance(state, str | None)):
        raise RecordingError(path, "an event is damaged", FROM_A_COPY)
    return Event(time_s, kind, state, json_object(path, data, "an event"))
