"""PLY, binary little endian; what is said about the points stands in comments of the header."""

from __future__ import annotations

from pathlib import Path

from picoradar.instrument.files.about import comments_of, texts_in
from picoradar.instrument.files.export.table import TableFile
from picoradar.instrument.files.points.ply import read_vertices

_NAMES = {"f8": "double", "u2": "ushort"}


def write_ply(path: Path, file: TableFile) -> None:
    """Write a point table; the same table gives the same bytes."""
    table, dtype = file.table, file.table.dtype
    comments = "".join(f"comment {comment}\n" for comment in comments_of(file.about))
    properties = "".join(f"property {_NAMES[dtype[name].str[1:]]} {name}\n" for name in dtype.names or ())
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment picoradar, scanner frame, mm\n{comments}"
        f"element vertex {len(table)}\n{properties}end_header\n"
    )
    path.write_bytes(header.encode("ascii") + table.tobytes())


def holds_ply(path: Path, file: TableFile) -> bool:
    """Return whether a file reads back as the table."""
    found = read_vertices(path)
    same = found.table.dtype == file.table.dtype and found.table.tobytes() == file.table.tobytes()
    return same and texts_in(found.comments) == file.about
