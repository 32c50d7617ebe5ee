"""LAS 1.4 by laspy, for point cloud viewers: coordinates in mm, in steps of 0.01 um."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.export.optional import library

_STEP_MM = 1e-5
_EXTRA = ("response_mv", "range_variance_mm2", "flags", "row", "column")
_INTENSITY_PER_MV = 100
_NO_DATE = datetime.date(2000, 1, 1)


def write_las(path: Path, table: NDArray[np.void]) -> None:
    """Write a point table; the same table gives the same bytes.

    All columns but the coordinates are extra dimensions under their own names. ``intensity`` is the response in
    hundredths of a mV for viewers that know nothing else (at most 65535).
    """
    laspy = library("laspy", path)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = _NO_DATE
    header.generating_software = "picoradar"
    header.scales = np.full(3, _STEP_MM)
    header.offsets = np.zeros(3)
    for name in _EXTRA:
        header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=table.dtype[name]))
    las = laspy.LasData(header)
    las.x, las.y, las.z = table["x"], table["y"], table["z"]
    for name in _EXTRA:
        las[name] = table[name]
    response = np.nan_to_num(table["response_mv"], nan=0.0)
    las.intensity = np.clip(np.round(response * _INTENSITY_PER_MV), 0, 65535).astype(np.uint16)
    las.write(str(path))


def holds_las(path: Path, table: NDArray[np.void]) -> bool:
    """Return whether a file reads back as the table, coordinates to half a step."""
    las = library("laspy", path).read(str(path))
    if len(las.points) != len(table):
        return False
    near = all(
        np.allclose(np.asarray(las[axis]), table[axis], rtol=0, atol=0.51 * _STEP_MM) for axis in ("x", "y", "z")
    )
    return near and all(np.array_equal(np.asarray(las[name]), table[name], equal_nan=True) for name in _EXTRA)
