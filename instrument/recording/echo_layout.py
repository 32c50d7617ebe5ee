"""Bytes of what a line knows of its echoes beside the points: the last of two, and how far light inside the target
stretches them.

The layout is part of the file format (docs/recording.md). All numbers are little endian, without padding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.line import LAST_ECHO, ScanLine

ECHO = np.dtype(
    [
        ("place", "<i4"),
        ("last_points_mm", "<f8", (3,)),
        ("last_range_mm", "<f8"),
        ("last_range_variance_mm2", "<f8"),
        ("last_response_mv", "<f8"),
        ("range_covariance_mm2", "<f8"),
    ]
)
"""The last echo of one place of a line, whose entry among the points is numbered from 0: 60 bytes."""

FIRST_LAYOUT = 4
"""Layout of the file from which on it has the tables."""


def echoes_blob(line: ScanLine) -> bytes:
    """Return the last echoes of a line as M x 60 bytes, for the M places that have one.

    Raises
    ------
    ValueError
        If an array of the line does not fit its number of columns.
    """
    count = len(line.columns)
    there = np.zeros(count, dtype=np.bool_)
    for name, shape in LAST_ECHO.items():
        values = getattr(line, name)
        if np.shape(values) != (count, *shape):
            raise ValueError(f"{name} has the shape {np.shape(values)}, not {(count, *shape)}")
        there |= ~np.isnan(values).all(axis=tuple(range(1, values.ndim)))
    table = np.empty(np.count_nonzero(there), dtype=ECHO)
    table["place"] = np.flatnonzero(there)
    for name in LAST_ECHO:
        table[name] = getattr(line, name)[there]
    return table.tobytes()


def echoes_of(blob: bytes, entries: int, count: int) -> dict[str, NDArray[np.float64]]:
    """Return the arrays of a `LastEcho` of a line of ``count`` places, of the blob of its last echoes.

    Raises
    ------
    ValueError
        If it has not as many entries, or one of them is of no place.
    """
    if len(blob) != entries * ECHO.itemsize:
        raise ValueError(f"{len(blob)} bytes for {entries} last echoes of {ECHO.itemsize} bytes")
    table = np.frombuffer(blob, dtype=ECHO)
    places = table["place"]
    if len(places) and not (places[0] >= 0 and places[-1] < count and (np.diff(places) > 0).all()):
        raise ValueError(f"its last echoes are of other places than its {count}")
    found = {}
    for name, shape in LAST_ECHO.items():
        found[name] = np.full((count, *shape), np.nan)
        found[name][places] = table[name]
    return found


def stretch_blob(line: ScanLine) -> bytes:
    """Return stretch and variance of the echoes of a line as N x 16 bytes; none where it does not know them.

    Raises
    ------
    ValueError
        If it is not of as many echoes as the line has columns.
    """
    if line.stretch is None:
        return b""
    if line.stretch.shape != (len(line.columns), 2):
        raise ValueError(f"stretch has the shape {line.stretch.shape}, not {(len(line.columns), 2)}")
    return line.stretch.astype("<f8").tobytes()


def stretch_of(blob: bytes, echoes: int, count: int) -> NDArray[np.float64]:
    """Return the (N, 2) stretch and variance of the N echoes of a line of ``count`` places.

    Raises
    ------
    ValueError
        If it is of another number of echoes.
    """
    if echoes != count or len(blob) != 16 * count:
        raise ValueError(f"{len(blob)} bytes for the stretch of {echoes} echoes, in a line of {count}")
    return np.frombuffer(blob, dtype="<f8").astype(np.float64).reshape(count, 2)
