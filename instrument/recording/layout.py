"""Bytes of a recording: the points and the traces of a line, each with its check sum.

The layout is part of the file format (docs/recording.md). All numbers are little endian, without padding.
"""

from __future__ import annotations

import struct
import threading
import zlib
from dataclasses import dataclass

import numpy as np
import zstandard
from numpy.typing import NDArray

from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording.limits import LARGEST_LINE_BYTES

POINT = np.dtype(
    [
        ("column", "<i4"),
        ("angle_rad", "<f8", (2,)),
        ("point_mm", "<f8", (3,)),
        ("covariance_mm2", "<f8", (3, 3)),
        ("range_mm", "<f8"),
        ("range_variance_mm2", "<f8"),
        ("response_mv", "<f8"),
        ("flags", "<u2"),
    ]
)
"""One point of a line: 142 bytes."""

_HEAD = struct.Struct("<qqqd")
_WAVE_HEAD = struct.Struct("<qqqq")
_ZSTD_LEVEL = 1


@dataclass(frozen=True)
class Wave:
    """The row of table ``wave``: sums of the A/D codes of all records of a line, compressed."""

    rows: int
    samples: int
    bytes_per_sum: int
    crc32: int
    data: bytes


def points_blob(line: ScanLine) -> bytes:
    """Return the (N,) points of a line as N x 142 bytes.

    Raises
    ------
    ValueError
        If an array of the line does not fit its number of columns.
    """
    table = np.empty(len(line.columns), dtype=POINT)
    for field, values in (
        ("column", line.columns),
        ("angle_rad", line.angles_rad),
        ("point_mm", line.points_mm),
        ("covariance_mm2", line.covariance_mm2),
        ("range_mm", line.range_mm),
        ("range_variance_mm2", line.range_variance_mm2),
        ("response_mv", line.response_mv),
        ("flags", line.flags),
    ):
        if np.shape(values) != table[field].shape:
            raise ValueError(f"{field} has the shape {np.shape(values)}, not {table[field].shape}")
        table[field] = values
    return table.tobytes()


def points_table(blob: bytes) -> NDArray[np.void]:
    """Return the (N,) structured array of `POINT` of a blob."""
    return np.frombuffer(blob, dtype=POINT)


def line_crc32(index: int, count: int, sweeps: int, device_time_s: float, *blobs: bytes) -> int:
    """Return the CRC-32 (zlib, polynomial 0x04C11DB7 reflected) over a line's numbers and the bytes of its echoes.

    It covers ``index, count, sweeps`` as int64 and ``device_time_s`` as float64, then the blobs: points, last echoes,
    stretch. Of a line without the latter two it is what it was before there were any.
    """
    crc = zlib.crc32(_HEAD.pack(index, count, sweeps, device_time_s))
    for blob in blobs:
        crc = zlib.crc32(blob, crc)
    return crc


def encode_wave(index: int, sums: NDArray[np.unsignedinteger]) -> Wave:
    """Compress the (N, S) sums of a line, without loss.

    What is compressed are the steps from sample to sample, small numbers, folded to 0, -1, 1, -2, 2 ... = 0, 1, 2, 3,
    4 ..., the low bytes of all first: a third less than zstd makes of the sums as they are (benchmarks/recording.py).
    """
    if sums.ndim != 2 or sums.dtype.kind != "u":
        raise ValueError(f"sums must be an (N, S) array of unsigned integers, not {sums.dtype} {sums.shape}")
    rows, samples = sums.shape
    width = sums.dtype.itemsize
    data = packed_sums(sums)
    return Wave(rows, samples, width, _wave_crc32(index, rows, samples, width, data), data)


def decode_wave(index: int, wave: Wave) -> NDArray[np.unsignedinteger]:
    """Return the (N, S) sums.

    Raises
    ------
    ValueError
        If the check sum or the length does not fit.
    """
    if _wave_crc32(index, wave.rows, wave.samples, wave.bytes_per_sum, wave.data) != wave.crc32:
        raise ValueError("the check sum of the traces does not fit")
    return unpacked_sums(wave.data, wave.rows, wave.samples, wave.bytes_per_sum)


def packed_sums(sums: NDArray[np.unsignedinteger]) -> bytes:
    """Compress (N, S) sums: folded steps along each row, low bytes first."""
    width = sums.dtype.itemsize
    folded = _folded_steps(np.ascontiguousarray(sums, dtype=f"<u{width}"))
    planes = np.ascontiguousarray(folded.view(np.uint8).reshape(-1, width).T)
    return compressed(planes.tobytes())


def unpacked_sums(data: bytes, rows: int, samples: int, width: int) -> NDArray[np.unsignedinteger]:
    """Return the sums (rows, samples) of ``width`` bytes each that `packed_sums` has compressed.

    Raises
    ------
    ValueError
        If the length does not fit.
    """
    plain = decompressed(data, rows * samples * width)
    planes = np.frombuffer(plain, dtype=np.uint8).reshape(width, -1)
    folded = np.ascontiguousarray(planes.T).view(f"<u{width}").reshape(rows, samples)
    return _sums_of(folded)


def compressed(plain: bytes) -> bytes:
    """Compress bytes with Zstandard.

    Raises
    ------
    ValueError
        If they are more than `decompressed` would unpack.
    """
    if len(plain) > LARGEST_LINE_BYTES:
        raise ValueError(f"the samples of the line have {len(plain)} bytes; at most {LARGEST_LINE_BYTES} are kept")
    return _compressor().compress(plain)


def decompressed(data: bytes, size: int) -> bytes:
    """Return ``size`` bytes that `compressed` has compressed.

    Raises
    ------
    ValueError
        If it is another number of bytes, or not Zstandard.
    """
    if not 0 <= size <= LARGEST_LINE_BYTES:
        raise ValueError(f"the samples claim {size} bytes; at most {LARGEST_LINE_BYTES} are unpacked")
    try:
        stated = zstandard.frame_content_size(data)  # -1: not stated; `max_output_size` only holds for such frames
        if stated not in (-1, size):
            raise ValueError(f"the samples have {stated} bytes instead of {size}")
        plain = zstandard.ZstdDecompressor().decompress(data, max_output_size=max(size, 1)) if size else b""
    except zstandard.ZstdError as error:
        raise ValueError(f"the samples cannot be decompressed ({error})") from error
    if len(plain) != size:
        raise ValueError(f"the samples have {len(plain)} bytes instead of {size}")
    return plain


def _folded_steps(sums: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    steps = sums.copy()
    steps[:, 1:] -= sums[:, :-1]  # modulo 2^bits, as everything here
    minus = np.negative(steps >> (8 * sums.itemsize - 1))  # all ones where the step is negative
    return np.asarray((steps << 1) ^ minus, dtype=sums.dtype)


def _sums_of(folded: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    steps = (folded >> 1) ^ np.negative(folded & 1)
    return np.asarray(np.cumsum(steps, axis=1, dtype=folded.dtype), dtype=folded.dtype)


def _wave_crc32(index: int, rows: int, samples: int, width: int, data: bytes) -> int:
    return zlib.crc32(data, zlib.crc32(_WAVE_HEAD.pack(index, rows, samples, width)))


_local = threading.local()


def _compressor() -> zstandard.ZstdCompressor:
    """Get this thread's compressor (they may not be shared between threads, and making one costs as much as a line)."""
    if not hasattr(_local, "compressor"):
        _local.compressor = zstandard.ZstdCompressor(level=_ZSTD_LEVEL)
    compressor: zstandard.ZstdCompressor = _local.compressor
    return compressor
