"""The vertices of a PLY file, text or binary, of any program."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.points.errors import PointFileError
from picoradar.instrument.files.points.limits import MOST_POINTS

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_EXPORT_AGAIN = "export it again as a PLY of points"
_LONGEST_HEADER = 100_000


@dataclass(frozen=True)
class _Header:
    form: str
    count: int
    dtype: np.dtype[np.void]
    end: int  # byte after the header
    lines: int  # lines of the header
    comments: list[str]


class Vertices(NamedTuple):
    """The (N,) structured array of the element ``vertex``, and the comments of the header."""

    table: NDArray[np.void]
    comments: list[str]


def read_vertices(path: Path) -> Vertices:
    """Read the element ``vertex``.

    Raises
    ------
    PointFileError
        If the file is no PLY, is cut off, or its vertices hold lists.
    OSError
        If it cannot be read.
    """
    content = path.read_bytes()
    header = _read_header(path, content)
    if header.form == "ascii":
        table = _read_text(path, content, header)
    else:
        table = np.frombuffer(content, dtype=header.dtype, count=header.count, offset=header.end)
    return Vertices(table, header.comments)


def _read_header(path: Path, content: bytes) -> _Header:
    if not content.startswith(b"ply"):
        raise PointFileError(path, "does not begin with 'ply'", _EXPORT_AGAIN)
    stop = content.find(b"end_header", 0, _LONGEST_HEADER)
    end = content.find(b"\n", stop) + 1
    if stop < 0 or end == 0:
        raise PointFileError(path, "has no end_header", _EXPORT_AGAIN)
    lines = content[:end].decode("ascii", errors="replace").splitlines()
    form, elements, fields = "", list[tuple[str, int]](), list[tuple[str, str]]()
    for number, words in enumerate((line.split() for line in lines), start=1):
        match words:
            case ["format", form, _]:
                if form not in _ORDERS:
                    raise PointFileError(path, f"the format '{form}' is not known", _EXPORT_AGAIN, line=number)
            case ["element", name, count] if re.fullmatch(r"[0-9]{1,18}", count):
                elements.append((name, int(count)))
            case ["property", kind, name] if kind in _TYPES and len(elements) == 1:
                fields.append((name, _ORDERS.get(form, "=") + _TYPES[kind]))
            case ["property", *_] if len(elements) == 1:
                raise PointFileError(path, f"'{' '.join(words)}' is not a plain number", _EXPORT_AGAIN, line=number)
            case _:
                pass
    if not form or not elements or elements[0][0] != "vertex":
        raise PointFileError(path, "its first element is not 'vertex'", _EXPORT_AGAIN)
    if len({name for name, _ in fields}) != len(fields) or not fields:
        raise PointFileError(path, "its vertices have no properties, or one twice", _EXPORT_AGAIN)
    stated, dtype = elements[0][1], np.dtype(fields)
    if stated > MOST_POINTS:
        raise PointFileError(path, f"states {stated} points; at most {MOST_POINTS} are read", "leave out some of them")
    missing = 0 if form == "ascii" else stated * dtype.itemsize - (len(content) - end)
    if missing > 0:
        raise PointFileError(path, f"is cut off: {missing} bytes of its {stated} points are missing", "copy it again")
    comments = [line.removeprefix("comment ") for line in lines if line.startswith("comment ")]
    return _Header(form, stated, dtype, end, len(lines), comments)


def _read_text(path: Path, content: bytes, header: _Header) -> NDArray[np.void]:
    lines = content[header.end :].decode("ascii", errors="replace").splitlines()[: header.count]
    if len(lines) < header.count:
        raise PointFileError(path, f"is cut off: {len(lines)} of {header.count} points are there", "copy it again")
    table = np.empty(header.count, dtype=header.dtype)
    for k, line in enumerate(lines):
        try:
            table[k] = tuple(map(float, line.split()))
        except (ValueError, OverflowError) as error:  # OverflowError: an integer property that is inf
            where = header.lines + k + 1
            raise PointFileError(path, f"'{line[:60]}' is no point ({error})", _EXPORT_AGAIN, line=where) from error
    return table
