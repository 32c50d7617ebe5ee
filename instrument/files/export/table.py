"""The columns of a point file: one name, unit and number type each, the same in every format."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.recording import Cloud

LAST_COLUMNS = ("last_range_mm", "last_range_variance_mm2", "last_response_mv", "range_covariance_mm2")
POINT_ROW = np.dtype(
    [
        ("x", "<f8"),
        ("y", "<f8"),
        ("z", "<f8"),
        ("response_mv", "<f8"),
        ("range_variance_mm2", "<f8"),
        ("flags", "<u2"),
        ("row", "<u2"),
        ("column", "<u2"),
        ("range_mm", "<f8"),
        ("last_x", "<f8"),
        ("last_y", "<f8"),
        ("last_z", "<f8"),
        *((name, "<f8") for name in LAST_COLUMNS),
    ]
)
"""Coordinates in mm in the scanner frame; numbers as float64, so that nothing is lost. A row is a place with a range:
that of its first echo. What begins with ``last``, and the covariance of the two ranges, is NaN where there is one echo.
"""


@dataclass(frozen=True)
class TableFile:
    """A point table (N,), and what is said about its points: JSON text by name."""

    table: NDArray[np.void]
    about: dict[str, str]


def point_rows(cloud: Cloud) -> NDArray[np.void]:
    """Return the (N,) table of the points with a range."""
    points = cloud.with_range()
    table = np.empty(len(points), dtype=POINT_ROW)
    table["x"], table["y"], table["z"] = points.points_mm.T
    table["last_x"], table["last_y"], table["last_z"] = points.last_points_mm.T
    for name in ("response_mv", "range_variance_mm2", "flags", "range_mm", *LAST_COLUMNS):
        table[name] = getattr(points, name)
    table["row"] = points.rows
    table["column"] = points.columns
    return table
