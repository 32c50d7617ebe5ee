"""Between a `ScanLine` and its rows in the tables ``line`` and ``wave``."""

from __future__ import annotations

from typing import Any

import numpy as np

from instrument.recording.layout import (
    POINT,
    Wave,
    decode_wave,
    encode_wave,
    line_crc32,
    points_blob,
    points_table,
)
from instrument.scan_line import ScanLine

INSERT_LINE = (
    "INSERT INTO line (k, device_time_s, acknowledged_at_s, n, sweeps, crc32, points) VALUES (?, ?, ?, ?, ?, ?, ?)"
)
INSERT_WAVE = "INSERT INTO wave (k, rows, samples, bytes_per_sum, crc32, data) VALUES (?, ?, ?, ?, ?, ?)"
SELECT_LINE = "SELECT k, device_time_s, n, sweeps, crc32, points FROM line WHERE k = ?"
SELECT_WAVE = "SELECT rows, samples, bytes_per_sum, crc32, data FROM wave WHERE k = ?"


def pack(line: ScanLine, acknowledged_at_s: float) -> tuple[tuple[Any, ...], tuple[Any, ...] | None]:
    """Return the row of ``line`` and, if the traces are kept, of ``wave``.

    Raises
    ------
    ValueError
        If the arrays of the line do not fit each other.
    """
    blob = points_blob(line)
    count, begun = len(line.columns), float(line.device_time_s)
    crc = line_crc32(line.index, count, line.sweeps, begun, blob)
    row = (line.index, begun, float(acknowledged_at_s), count, line.sweeps, crc, blob)
    if line.sums is None:
        return row, None
    if len(line.sums) != count:
        raise ValueError(f"{len(line.sums)} traces for {count} points")
    wave = encode_wave(line.index, line.sums)
    return row, (line.index, wave.rows, wave.samples, wave.bytes_per_sum, wave.crc32, wave.data)


def unpack(row: tuple[Any, ...], wave_row: tuple[Any, ...] | None) -> ScanLine:
    """Return the line of a row of ``line`` and, if given, of ``wave``.

    Raises
    ------
    ValueError
        If a check sum or a length does not fit.
    """
    index, begun, count, sweeps, crc, blob = row
    if line_crc32(index, count, sweeps, begun, blob) != crc:
        raise ValueError("the check sum of the points does not fit")
    if len(blob) != count * POINT.itemsize:
        raise ValueError(f"{len(blob)} bytes for {count} points of {POINT.itemsize} bytes")
    table = points_table(blob)
    sums = None if wave_row is None else decode_wave(index, Wave(*wave_row))

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
        sums=sums,
        sweeps=sweeps,
        device_time_s=begun,
    )
