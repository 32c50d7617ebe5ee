"""Points in a text file: with or without a header row, commas, semicolons or white space, comments."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.points.errors import PointFileError

_SEPARATORS = re.compile(r"[,;\s]+")
_COMMENT = re.compile(r"#|//|%")
_REMEDY = "give one point per line: x, y, z in mm, and a header row if there are more columns"


@dataclass(frozen=True)
class Columns:
    """Numbers of a text file by column name (lower case; ``x y z`` where there is no header row), and the comments that
    have a line of their own."""

    values: dict[str, NDArray[np.float64]]
    line_numbers: list[int]
    comments: list[str]


def read_text(path: Path) -> Columns:
    """Read a text file of points.

    Raises
    ------
    PointFileError
        With the first line that is not a point.
    OSError
        If it cannot be read.
    """
    content = path.read_bytes()
    if b"\0" in content:
        raise PointFileError(path, "is binary, not text", _REMEDY)
    names: list[str] = []
    rows: list[list[float]] = []
    numbers: list[int] = []
    comments: list[str] = []
    for number, line in enumerate(content.decode("utf-8-sig", errors="replace").splitlines(), start=1):
        text = _COMMENT.split(line, maxsplit=1)[0].strip()
        if not text:
            comments.append(line.strip().removeprefix("#"))
            continue
        if ";" in text and "," in text:  # 1,5;2,5 would be read as four numbers
            raise PointFileError(path, "both ; and , are used", "write decimals with a point", line=number)
        words = [word for word in _SEPARATORS.split(text) if word]
        if not words:
            raise PointFileError(path, f"'{text[:60]}' has separators and no numbers", _REMEDY, line=number)
        if not names and not rows and not _is_number(words[0]):
            names = [word.strip("\"'").lower() for word in words]
            continue
        try:
            rows.append([float(word) for word in words])
        except ValueError as error:
            raise PointFileError(path, f"'{line.strip()[:60]}' is not all numbers", _REMEDY, line=number) from error
        numbers.append(number)
        if len(rows[-1]) != len(names or rows[0]):
            what = f"{len(rows[-1])} numbers, where {len(names or rows[0])} are in the first row"
            raise PointFileError(path, what, _REMEDY, line=number)
    if not rows:
        raise PointFileError(path, "holds no points", _REMEDY)
    if not names:
        names = ["x", "y", "z", *(f"column {k}" for k in range(4, len(rows[0]) + 1))]
    if len(rows[0]) < 3:
        raise PointFileError(path, f"has {len(rows[0])} columns", _REMEDY, line=numbers[0])
    table = np.array(rows, dtype=np.float64)
    return Columns({name: table[:, k] for k, name in enumerate(names)}, numbers, comments)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
