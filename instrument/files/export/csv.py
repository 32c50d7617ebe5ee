"""CSV: one header row with the units in the names, then one row per point; numbers read back to the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_TITLES = {"x": "x_mm", "y": "y_mm", "z": "z_mm"}


def write_csv(path: Path, table: NDArray[np.void]) -> None:
    """Write a point table; the same table gives the same bytes."""
    names = table.dtype.names or ()
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(_TITLES.get(name, name) for name in names) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())


def holds_csv(path: Path, table: NDArray[np.void]) -> bool:
    """Return whether a file reads back as the table."""
    rows = path.read_text(encoding="ascii").splitlines()[1:]
    found = np.array([tuple(map(float, row.split(","))) for row in rows], dtype=table.dtype)
    return found.tobytes() == table.tobytes()
