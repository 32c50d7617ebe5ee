"""Between a `ZeroReading` and its row in the table ``zero``."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import astuple
from pathlib import Path

import numpy as np

from picoradar.drivers.errors import DECODER_ERRORS, decoder_words
from picoradar.drivers.traces import Trace
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import ZeroReading
from picoradar.instrument.recording.errors import RecordingError
from picoradar.instrument.recording.header import TraceForm
from picoradar.instrument.recording.layout import Wave, decode_wave, encode_wave
from picoradar.instrument.recording.window_layout import WindowRow, decode_windows, encode_windows

COLUMNS = (
    *("id", "lines", "device_time_s", "x_rad", "y_rad", "mark_mm", "mark_sd_mm", "sweeps", "clipped", "head_crc32"),
    *("n", "samples", "bytes_per_sum", "crc32", "pieces", "data"),
)
INSERT_ZERO = f"INSERT INTO zero ({', '.join(COLUMNS)}) VALUES ({', '.join('?' * len(COLUMNS))})"
SELECT_ZERO = f"SELECT {', '.join(COLUMNS)} FROM zero ORDER BY id LIMIT 10000"
"""All readings: a scan has two, and two more for each time that it goes on."""
SELECT_ONE_ZERO = f"SELECT {', '.join(COLUMNS)} FROM zero WHERE id = ?"
FIRST_LAYOUT = 3
"""Layout of the file from which on it has the table."""

_HEAD = struct.Struct("<qqqqddddd")


def pack_zero(number: int, reading: ZeroReading, lines: int) -> tuple[object, ...]:
    """Return the row of a reading; ``lines`` are those that the recording holds before it.

    Raises
    ------
    ValueError
        If it has no raw records, or its arrays do not fit each other.
    """
    clipped = int(reading.clipped.any())
    if reading.windows is not None:
        sweeps, row = 0, encode_windows(number, reading.windows)
        raw: tuple[object, ...] = astuple(row)
    elif reading.traces is not None:
        sweeps, wave = reading.traces.sweeps, encode_wave(number, reading.traces.sums)
        raw = (wave.rows, wave.samples, wave.bytes_per_sum, wave.crc32, None, wave.data)
    else:
        raise ValueError("a reading of the zero mark has no raw records")
    x_rad, y_rad = reading.angles_rad.tolist()
    floats = (float(reading.device_time_s), x_rad, y_rad, float(reading.mark_mm), float(reading.mark_sd_mm))
    head_crc = zlib.crc32(_HEAD.pack(number, lines, sweeps, clipped, *floats))
    return (number, lines, *floats, sweeps, clipped, head_crc, *raw)


def reading_of(path: Path, row: tuple[object, ...], form: TraceForm | None) -> ZeroReading:
    """Return the reading of a row of a recording, as `unpack_zero`.

    Raises
    ------
    RecordingError
        If it is damaged.
    """
    try:
        return unpack_zero(row, form)
    except DECODER_ERRORS as error:
        what = f"a reading of the zero mark is damaged: {decoder_words(error)}"
        raise RecordingError(path, what, "scan again") from error


def unpack_zero(row: tuple[object, ...], form: TraceForm | None) -> ZeroReading:
    """Return the reading of a row.

    Parameters
    ----------
    row : tuple
        All columns, in their order.
    form : TraceForm or None
        Instants and scale of raw samples, by the header.

    Raises
    ------
    ValueError
        If a check sum or a length does not fit, or the header says nothing about traces.
    """
    value: JsonObject = dict(zip(COLUMNS, row, strict=True))
    floats = [value[name] for name in COLUMNS[2:7]]
    head = zlib.crc32(_HEAD.pack(value["id"], value["lines"], value["sweeps"], value["clipped"], *floats))
    if head != value["head_crc32"] or not all(map(math.isfinite, floats)):
        raise ValueError("the check sum of the reading does not fit")
    if form is None:
        raise ValueError("it has raw samples, but the header says nothing about traces")
    size, crc = (value["samples"], value["bytes_per_sum"]), value["crc32"]
    traces = windows = None
    if value["pieces"] is not None:
        row_of_windows = WindowRow(value["n"], *size, crc, value["pieces"], value["data"])
        windows = decode_windows(value["id"], row_of_windows, form.scale)
    elif value["sweeps"] < 1:
        raise ValueError(f"its traces have {value['sweeps']} sweeps")
    else:
        sums = decode_wave(value["id"], Wave(value["n"], *size, crc, value["data"]))
        traces = Trace(sums, value["sweeps"], form.times_ps, form.scale)
    records = len(windows) if windows is not None else value["n"]
    return ZeroReading(
        angles_rad=np.array([value["x_rad"], value["y_rad"]]),
        mark_mm=value["mark_mm"],
        mark_sd_mm=value["mark_sd_mm"],
        device_time_s=value["device_time_s"],
        clipped=np.full(records, bool(value["clipped"])),
        traces=traces,
        windows=windows,
        lines=value["lines"],
    )
