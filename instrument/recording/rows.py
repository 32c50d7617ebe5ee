"""Between a `ScanLine` and its rows in the tables ``line``, ``echo``, ``stretch``, ``wave`` and ``window``."""

from __future__ import annotations

import sqlite3
from dataclasses import astuple
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from picoradar.drivers.traces import Trace
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import echo_layout
from picoradar.instrument.recording.errors import RecordingError
from picoradar.instrument.recording.header import TraceForm
from picoradar.instrument.recording.layout import (
    POINT,
    Wave,
    decode_wave,
    encode_wave,
    line_crc32,
    points_blob,
    points_table,
)
from picoradar.instrument.recording.window_layout import WindowRow, decode_windows, encode_windows

INSERT_LINE = (
    "INSERT INTO line (k, device_time_s, acknowledged_at_s, n, sweeps, crc32, points) VALUES (?, ?, ?, ?, ?, ?, ?)"
)
INSERT_WAVE = "INSERT INTO wave (k, rows, samples, bytes_per_sum, crc32, data) VALUES (?, ?, ?, ?, ?, ?)"
INSERT_WINDOW = "INSERT INTO window (k, n, samples, bytes_per_sum, crc32, pieces, data) VALUES (?, ?, ?, ?, ?, ?, ?)"
INSERT_ECHO = "INSERT INTO echo (k, n, data) VALUES (?, ?, ?)"
INSERT_STRETCH = "INSERT INTO stretch (k, n, data) VALUES (?, ?, ?)"
_SELECT_LINE = "SELECT k, device_time_s, n, sweeps, crc32, points FROM line WHERE k = ?"
_SELECT_WAVE = "SELECT rows, samples, bytes_per_sum, crc32, data FROM wave WHERE k = ?"
_SELECT_WINDOW = "SELECT n, samples, bytes_per_sum, crc32, pieces, data FROM window WHERE k = ?"
_SELECT_ECHO = "SELECT n, data FROM echo WHERE k = ?"
_SELECT_STRETCH = "SELECT n, data FROM stretch WHERE k = ?"
_SELECT_RAW = {1: (_SELECT_WAVE,), **dict.fromkeys((2, 3, 4), (_SELECT_WAVE, _SELECT_WINDOW))}
"""Queries for the raw samples of a line, by the layout of the file."""


def checked_layout(path: Path, layout: int) -> int:
    """Return the layout that a file says it has.

    Raises
    ------
    RecordingError
        If there never was one of that number.
    """
    if layout not in _SELECT_RAW:
        raise RecordingError(path, f"has layout {layout}, which was never written", "restore it from a copy")
    return layout


Row = tuple[Any, ...]  # values as SQLite has them


class Rows(NamedTuple):
    """The rows of a line in each table; None where it has nothing."""

    line: Row
    wave: Row | None
    window: Row | None
    echo: Row | None
    stretch: Row | None


def fetch(connection: sqlite3.Connection, layout: int, index: int, *, raw: bool) -> Rows | None:
    """Read the rows of a line out of a file of a layout, None where it has no such line.

    Raises
    ------
    sqlite3.Error
    """

    def one(query: str) -> Row | None:
        found: Row | None = connection.execute(query, (index,)).fetchone()
        return found

    line = one(_SELECT_LINE)
    if line is None:
        return None
    wave, window, *_ = (*(one(query) if raw else None for query in _SELECT_RAW[layout]), None)
    if layout < echo_layout.FIRST_LAYOUT:
        return Rows(line, wave, window, None, None)
    return Rows(line, wave, window, one(_SELECT_ECHO), one(_SELECT_STRETCH))


def pack(line: ScanLine, acknowledged_at_s: float) -> Rows:
    """Return the row of ``line``, and of each other table that the line has something for.

    Raises
    ------
    ValueError
        If the arrays of the line do not fit each other.
    """
    blob, echoes, stretch = points_blob(line), echo_layout.echoes_blob(line), echo_layout.stretch_blob(line)
    count, begun = len(line.columns), float(line.device_time_s)
    crc = line_crc32(line.index, count, line.sweeps, begun, blob, echoes, stretch)
    row = (line.index, begun, float(acknowledged_at_s), count, line.sweeps, crc, blob)
    wave_row = window_row = None
    if line.sums is not None:
        if len(line.sums) != count:
            raise ValueError(f"{len(line.sums)} traces for {count} points")
        wave_row = (line.index, *astuple(encode_wave(line.index, line.sums)))
    if line.windows is not None:
        window_row = (line.index, *astuple(encode_windows(line.index, line.windows)))
    echo_row = (line.index, len(echoes) // echo_layout.ECHO.itemsize, echoes) if echoes else None
    stretch_row = (line.index, count, stretch) if stretch else None
    return Rows(row, wave_row, window_row, echo_row, stretch_row)


def unpack(rows: Rows, form: TraceForm | None) -> ScanLine:
    """Return the line of its rows, as the queries here give them.

    Parameters
    ----------
    rows : Rows
    form : TraceForm or None
        Instants and scale of raw samples, by the header.

    Raises
    ------
    ValueError
        If a check sum or a length does not fit, or there are raw samples without a form.
    """
    index, begun, count, sweeps, crc, blob = rows.line
    entries, echoes = (0, b"") if rows.echo is None else rows.echo
    measured, stretch = (0, b"") if rows.stretch is None else rows.stretch
    if line_crc32(index, count, sweeps, begun, blob, echoes, stretch) != crc:
        raise ValueError("the check sum of the points does not fit")
    if len(blob) != count * POINT.itemsize:
        raise ValueError(f"{len(blob)} bytes for {count} points of {POINT.itemsize} bytes")
    table = points_table(blob)
    traces = windows = None
    if rows.wave is not None:
        sums, known = decode_wave(index, Wave(*rows.wave)), _known(form)
        traces = Trace(sums, sweeps, known.times_ps, known.scale)
    if rows.window is not None:
        windows = decode_windows(index, WindowRow(*rows.window), _known(form).scale)

    def column(name: str) -> Any:
        return np.ascontiguousarray(table[name].astype(table[name].dtype.newbyteorder("=")))

    return ScanLine(
        index=index,
        columns=column("column"),
        angles_rad=column("angle_rad"),
        points_mm=column("point_mm"),
        covariance_mm2=column("covariance_mm2"),
        range_mm=column("range_mm"),
        range_variance_mm2=column("range_variance_mm2"),
        response_mv=column("response_mv"),
        flags=column("flags"),
        traces=traces,
        sweeps=sweeps,
        device_time_s=begun,
        windows=windows,
        stretch=None if rows.stretch is None else echo_layout.stretch_of(stretch, measured, count),
        **echo_layout.echoes_of(echoes, entries, count),
    )


def _known(form: TraceForm | None) -> TraceForm:
    if form is None:
        raise ValueError("it has raw samples, but the header says nothing about traces")
    return form
