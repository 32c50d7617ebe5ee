"""Bytes of the raw windows of a line: their forms and their sums, with one check sum.

The layout is part of the file format (docs/recording.md). All numbers are little endian, without padding.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import CodeScale
from picoradar.instrument.line import PULSES, LineWindows
from picoradar.instrument.recording.layout import compressed, decompressed, packed_sums, unpacked_sums

PIECE = np.dtype(
    [
        ("column", "<i4"),
        ("start_fs", "<i8"),
        ("step_fs", "<i4"),
        ("samples", "<u2"),
        ("sweeps", "<u2"),
        ("flags", "u1"),
    ]
)
"""One window: 21 bytes."""

ECHO, RETAKEN, CLIPPED = 1, 2, 4  # flags of a window; of its record those of the last two

_HEAD = struct.Struct("<qqqq")


@dataclass(frozen=True)
class WindowRow:
    """The row of table ``window``: n windows of ``samples`` sums together, their forms and their sums, compressed."""

    n: int
    samples: int
    bytes_per_sum: int
    crc32: int
    pieces: bytes
    data: bytes


def encode_windows(index: int, windows: LineWindows) -> WindowRow:
    """Compress the raw windows of a line, without loss.

    Raises
    ------
    ValueError
        If their arrays do not fit each other, or a number is too large for its field.
    """
    count = PULSES * len(windows)
    if windows.samples.shape != (len(windows), PULSES) or windows.samples.sum() != len(windows.sums):
        raise ValueError(f"{len(windows.sums)} sums for windows of {windows.samples.sum()} samples together")
    table = np.empty(count, dtype=PIECE)
    flags = RETAKEN * windows.retaken + CLIPPED * windows.clipped
    for field, values in (
        ("column", np.repeat(windows.columns, PULSES)),
        ("start_fs", in_fs(windows.start_ps).ravel()),
        ("step_fs", in_fs(windows.step_ps).ravel()),
        ("samples", windows.samples.ravel()),
        ("sweeps", windows.sweeps.ravel()),
        ("flags", np.repeat(flags, PULSES) + ECHO * (np.arange(count) % PULSES)),
    ):
        table[field] = values
        if not np.array_equal(table[field], values):
            raise ValueError(f"{field} of a window is too large to be stored: {np.max(values)}")
    pieces, data = compressed(table.tobytes()), packed_sums(windows.sums[None])
    head = count, len(windows.sums), windows.sums.dtype.itemsize
    return WindowRow(*head, _crc32(index, *head, pieces, data), pieces, data)


def decode_windows(index: int, row: WindowRow, scale: CodeScale) -> LineWindows:
    """Return the raw windows of a line, whose codes have this scale.

    Raises
    ------
    ValueError
        If the check sum or a length does not fit.
    """
    if _crc32(index, row.n, row.samples, row.bytes_per_sum, row.pieces, row.data) != row.crc32:
        raise ValueError("the check sum of the windows does not fit")
    table = np.frombuffer(decompressed(row.pieces, row.n * PIECE.itemsize), dtype=PIECE).reshape(-1, PULSES)
    if table["samples"].sum(dtype=np.int64) != row.samples:
        raise ValueError(f"windows of {table['samples'].sum(dtype=np.int64)} samples have {row.samples} sums")
    flags = table["flags"][:, 0]
    return LineWindows(
        columns=table["column"][:, 0].astype(np.int32),
        retaken=(flags & RETAKEN) != 0,
        clipped=(flags & CLIPPED) != 0,
        start_ps=table["start_fs"] / 1000,
        step_ps=table["step_fs"] / 1000,
        samples=table["samples"].astype(np.int32),
        sweeps=table["sweeps"].astype(np.int32),
        sums=unpacked_sums(row.data, 1, row.samples, row.bytes_per_sum)[0],
        scale=scale,
    )


def in_fs(times_ps: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return times in whole femtoseconds, the unit of the file (and of the device)."""
    return np.rint(times_ps * 1000).astype(np.int64)


def _crc32(index: int, n: int, samples: int, width: int, pieces: bytes, data: bytes) -> int:
    return zlib.crc32(data, zlib.crc32(pieces, zlib.crc32(_HEAD.pack(index, n, samples, width))))
