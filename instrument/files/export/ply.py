"""PLY, binary little endian."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.points.ply import read_vertices

_NAMES = {"f8": "double", "u2": "ushort"}


def write_ply(path: Path, table: NDArray[np.void]) -> None:
    """Write a point table; the same table gives the same bytes."""
    dtype = table.dtype
    properties = "".join(f"property {_NAMES[dtype[name].str[1:]]} {name}\n" for name in dtype.names or ())
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment picoradar, scanner frame, mm\n"
        f"element vertex {len(table)}\n{properties}end_header\n"
    )
    path.write_bytes(header.encode("ascii") + table.tobytes())


def holds_ply(path: Path, table: NDArray[np.void]) -> bool:
    """Return whether a file reads back as the table."""
    found = read_vertices(path)
    return found.dtype == table.dtype and found.tobytes() == table.tobytes()
