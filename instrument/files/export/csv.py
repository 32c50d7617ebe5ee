"""CSV: one header row with the units in the names, then one row per point; numbers read back to the same bits.

What is said about the points stands in comments below the header row, which thus stays the first line.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from picoradar.instrument.files.about import comments_of, texts_in
from picoradar.instrument.files.export.table import TableFile

_COORDINATES = ("x", "y", "z", "last_x", "last_y", "last_z")
_TITLES = {name: f"{name}_mm" for name in _COORDINATES}


def write_csv(path: Path, file: TableFile) -> None:
    """Write a point table; the same table gives the same bytes."""
    names = file.table.dtype.names or ()
    with path.open("w", encoding="ascii", newline="\n") as text:
        text.write(",".join(_TITLES.get(name, name) for name in names) + "\n")
        text.writelines(f"# {comment}\n" for comment in comments_of(file.about))
        text.writelines(",".join(map(repr, row)) + "\n" for row in file.table.tolist())


def holds_csv(path: Path, file: TableFile) -> bool:
    """Return whether a file reads back as the table."""
    lines = path.read_text(encoding="ascii").splitlines()[1:]
    rows = [tuple(map(float, line.split(","))) for line in lines if not line.startswith("#")]
    about = texts_in(line.removeprefix("#") for line in lines if line.startswith("#"))
    return np.array(rows, dtype=file.table.dtype).tobytes() == file.table.tobytes() and about == file.about
