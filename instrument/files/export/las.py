"""LAS 1.4 by laspy, for point cloud viewers: coordinates in mm, in steps of 0.01 um; an echo is a return.

A place with two echoes has two points one after the other, return 1 of 2 (the first) and 2 of 2 (the last), with a
range and a variance of their own; a place with one has return 1 of 1. One point a place are the first returns.
"""

from __future__ import annotations

import datetime
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.export.optional import library
from picoradar.instrument.files.export.table import TableFile
from picoradar.instrument.recording import Cloud

_STEP_MM = 1e-5
_EXTRA = (
    "response_mv",
    "range_variance_mm2",
    "flags",
    "row",
    "column",
    "range_mm",
    "range_sd_mm",
    "range_covariance_mm2",
)
_RETURN = ("return_number", "number_of_returns")
_RETURN_ROW = np.dtype(
    [
        *((name, "<f8") for name in ("x", "y", "z", "response_mv", "range_variance_mm2")),
        *((name, "<u2") for name in ("flags", "row", "column")),
        *((name, "<f8") for name in ("range_mm", "range_sd_mm", "range_covariance_mm2")),
        *((name, "u1") for name in _RETURN),
    ]
)
_INTENSITY_PER_MV = 100
_NO_DATE = datetime.date(2000, 1, 1)
USER_ID, RECORD_ID = "picoradar", 1
"""Name and number of the variable length record with what is said about the points."""


def return_rows(points: Cloud) -> NDArray[np.void]:
    """Return the table of the echoes of points with a range, those of a place one after the other."""
    returns = 1 + points.two_echoes
    place = np.repeat(np.arange(len(points)), returns)
    last = np.diff(place, prepend=-1) == 0
    table = np.empty(len(place), dtype=_RETURN_ROW)

    def of_each(first: NDArray[np.float64], of_last: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(last if first.ndim == 1 else last[:, None], of_last[place], first[place])

    table["x"], table["y"], table["z"] = of_each(points.points_mm, points.last_points_mm).T
    for name in ("range_mm", "range_variance_mm2", "response_mv"):
        table[name] = of_each(getattr(points, name), getattr(points, f"last_{name}"))
    table["range_sd_mm"] = np.sqrt(table["range_variance_mm2"])
    table["range_covariance_mm2"] = points.range_covariance_mm2[place]
    table["flags"], table["row"], table["column"] = points.flags[place], points.rows[place], points.columns[place]
    table["return_number"], table["number_of_returns"] = 1 + last, returns[place]
    return table


def write_las(path: Path, file: TableFile) -> None:
    """Write a table of echoes; the same table gives the same bytes.

    All columns but the coordinates and the numbers of returns are extra dimensions under their own names.
    ``intensity`` is the response in hundredths of a mV for viewers that know nothing else (at most 65535). What is said
    about the points is a variable length record, JSON text.
    """
    laspy = library("laspy", path)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = _NO_DATE
    header.generating_software = "picoradar"
    header.scales = np.full(3, _STEP_MM)
    header.offsets = np.zeros(3)
    table = file.table
    for name in _EXTRA:
        header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=table.dtype[name]))
    if file.about:
        header.vlrs.append(laspy.VLR(USER_ID, RECORD_ID, "about the points", _record(file)))
    las = laspy.LasData(header)
    las.x, las.y, las.z = table["x"], table["y"], table["z"]
    for name in (*_EXTRA, *_RETURN):
        las[name] = table[name]
    response = np.nan_to_num(table["response_mv"], nan=0.0)
    las.intensity = np.clip(np.round(response * _INTENSITY_PER_MV), 0, 65535).astype(np.uint16)
    las.write(str(path))


def holds_las(path: Path, file: TableFile) -> bool:
    """Return whether a file reads back as the table, coordinates to half a step."""
    las = library("laspy", path).read(str(path))
    table = file.table
    if len(las.points) != len(table):
        return False
    near = all(
        np.allclose(np.asarray(las[axis]), table[axis], rtol=0, atol=0.51 * _STEP_MM) for axis in ("x", "y", "z")
    )
    same = all(np.array_equal(np.asarray(las[name]), table[name], equal_nan=True) for name in (*_EXTRA, *_RETURN))
    said = [vlr.record_data for vlr in las.header.vlrs if vlr.user_id == USER_ID]
    return near and same and said == ([_record(file)] if file.about else [])


def _record(file: TableFile) -> bytes:
    return json.dumps({name: json.loads(text) for name, text in file.about.items()}, sort_keys=True).encode("ascii")
