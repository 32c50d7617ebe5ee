"""The columns of a point file: one name, unit and number type each, the same in every format."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.recording import Cloud

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
    ]
)
"""Coordinates in mm in the scanner frame; numbers as float64, so that nothing is lost."""


def point_rows(cloud: Cloud) -> NDArray[np.void]:
    """Return the (N,) table of the points with a range."""
    points = cloud.with_range()
    table = np.empty(len(points), dtype=POINT_ROW)
    table["x"], table["y"], table["z"] = points.points_mm.T
    table["response_mv"] = points.response_mv
    table["range_variance_mm2"] = points.range_variance_mm2
    table["flags"] = points.flags
    table["row"] = points.rows
    table["column"] = points.columns
    return table
