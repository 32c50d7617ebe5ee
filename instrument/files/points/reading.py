"""`read_points`: points for a registration, from a recording or from a point file of any program."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.errors import DECODER_ERRORS, decoder_words
from picoradar.instrument.files.about import NAMES, About, error_of, read_texts, texts_in
from picoradar.instrument.files.points.archive import read_arrays
from picoradar.instrument.files.points.errors import PointFileError
from picoradar.instrument.files.points.limits import LARGEST_FILE_BYTES, MOST_POINTS
from picoradar.instrument.files.points.ply import read_vertices
from picoradar.instrument.files.points.text import read_text
from picoradar.instrument.recording import Recording, range_error_in

SUFFIXES = (".ply", ".csv", ".xyz", ".npz")
_SQLITE = b"SQLite format 3\0"
_RESPONSES = ("response_mv", "response")
_ARRAYS = ("points_mm", "points", "row", "column", "origin_mm", "covariance_mm2", "response_mv", *NAMES)


@dataclass(frozen=True)
class PointFile:
    """Points, and what else the file says about them.

    Attributes
    ----------
    points : (N, 3) float array
        mm.
    origin : (3,) float array or None
        Where the scanner stood, in the frame of the points; None if the file does not say.
    covariance : (N, 3, 3) float array or None
        mm^2.
    response_mv : (N,) float array or None
    grid : (N, 2) int array or None
        Raster row and column.
    about : About
        The range error that all points share, and how the check of the range zero came out, as far as the file says.
    """

    points: NDArray[np.float64]
    origin: NDArray[np.float64] | None = None
    covariance: NDArray[np.float64] | None = None
    response_mv: NDArray[np.float64] | None = None
    grid: NDArray[np.int32] | None = None
    about: About = field(default_factory=About)

    @property
    def range_bias_mm(self) -> float | None:
        """Get the standard deviation of the range error that all points share, what was taken off already apart; None
        if the file does not say, or it was never measured."""
        return None if self.about.range_error is None else self.about.range_error.sd_mm


def is_recording(path: str | os.PathLike[str]) -> bool:
    """Get whether a file is a recording, by its content.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    with Path(path).open("rb") as content:
        return content.read(len(_SQLITE)) == _SQLITE


def read_points(path: str | os.PathLike[str]) -> PointFile:
    """Read points in mm.

    Parameters
    ----------
    path : path
        A recording (recognised by its content) or a ``.ply``, ``.csv``, ``.xyz`` or ``.npz`` file. Of two echoes at
        one place the first is the point; the last takes no part.

    Raises
    ------
    PointFileError
        Naming the file, the line, what was found and what to do.
    RecordingError
        If a recording is damaged.
    """
    file = Path(path)
    if not file.is_file():
        raise PointFileError(file, "there is no such file", "give the path of a recording or a point file")
    try:
        with file.open("rb") as content:
            beginning = content.read(len(_SQLITE))
        if not beginning:
            raise PointFileError(file, "is empty", "export it again")
        if beginning == _SQLITE:
            return _from_recording(file)
        if file.stat().st_size > LARGEST_FILE_BYTES:
            raise PointFileError(file, f"has more than {LARGEST_FILE_BYTES} bytes", "leave out points and columns")
        return _from_file(file)
    except OSError as error:
        raise PointFileError(file, f"cannot be read ({error.strerror or error})", "check its permissions") from error
    except DECODER_ERRORS as error:
        if isinstance(error, PointFileError):
            raise
        raise PointFileError(file, f"cannot be read ({decoder_words(error)})", "export it again") from error


def _from_recording(file: Path) -> PointFile:
    with Recording.open(file) as recording:
        every = recording.cloud()
        cloud, known = every.with_range(), range_error_in(recording.header, every)
    about = About(error_of(known) if known else None)
    return PointFile(cloud.points_mm, np.zeros(3), cloud.covariance_mm2, cloud.response_mv, cloud.grid, about)


def _from_file(file: Path) -> PointFile:
    suffix = file.suffix.lower()
    if suffix == ".npz":
        found, texts = _from_archive(file)
        numbers = None
    elif suffix == ".ply":
        table, comments = read_vertices(file)
        found = _from_columns(file, {name.lower(): table[name].astype(np.float64) for name in table.dtype.names or ()})
        texts, numbers = texts_in(comments), None
    elif suffix in (".csv", ".xyz"):
        columns = read_text(file)
        found = _from_columns(file, columns.values)
        texts, numbers = texts_in(columns.comments), columns.line_numbers
    else:
        raise PointFileError(file, f"the ending '{file.suffix}' is not known", f"use one of {' '.join(SUFFIXES)}")
    _check(file, found, numbers)
    return replace(found, about=read_texts(texts))


def _from_columns(file: Path, values: Mapping[str, NDArray[np.float64]]) -> PointFile:
    axes = []
    for axis in "xyz":
        name = next((name for name in (axis, f"{axis}_mm") if name in values), None)
        if name is None:
            raise PointFileError(
                file,
                f"has the columns {', '.join(values)}, none of them {axis} or {axis}_mm",
                "name the columns x, y, z",
            )
        axes.append(values[name])
    response = next((values[name] for name in _RESPONSES if name in values), None)
    grid = None
    if "row" in values and "column" in values:
        grid = _grid(file, values["row"], values["column"])
    return PointFile(np.column_stack(axes), response_mv=response, grid=grid)


def _from_archive(file: Path) -> tuple[PointFile, dict[str, str]]:
    found = read_arrays(file, _ARRAYS)
    points = next((found[name] for name in ("points_mm", "points") if name in found), None)
    if points is None:
        raise PointFileError(
            file, f"has the arrays {', '.join(found)} of points", "put the points into an array points_mm of (N, 3)"
        )
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        raise PointFileError(file, f"its points are {points.dtype} {points.shape}", "make them numbers of (N, 3)")
    count = len(points)
    rows, columns = (_array(file, found, name, (count,)) for name in ("row", "column"))
    texts = {name: _text(file, name, found[name]) for name in NAMES if name in found}
    arrays = PointFile(
        np.ascontiguousarray(points, dtype=np.float64),
        origin=_array(file, found, "origin_mm", (3,)),
        covariance=_array(file, found, "covariance_mm2", (count, 3, 3)),
        response_mv=_array(file, found, "response_mv", (count,)),
        grid=None if rows is None or columns is None else _grid(file, rows, columns),
    )
    return arrays, texts


def _text(file: Path, name: str, value: NDArray[np.generic]) -> str:
    if value.shape != () or value.dtype.kind != "U":
        what = f"its array {name} is {value.dtype} {value.shape}"
        raise PointFileError(file, what, "make it one text, or leave it out")
    return str(value)


def _grid(file: Path, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.int32]:
    places = np.column_stack([rows, columns])
    if not (np.abs(places) <= np.iinfo(np.int32).max).all():  # also true for NaN
        raise PointFileError(file, "has rows and columns that are no places of a raster", "leave these columns out")
    return places.astype(np.int32)


def _array(
    file: Path, found: Mapping[str, NDArray[np.generic]], name: str, shape: tuple[int, ...]
) -> NDArray[np.float64] | None:
    values = found.get(name)
    if values is None:
        return None
    if values.shape != shape or values.dtype.kind not in "fiu":
        what = f"its array {name} is {values.dtype} {values.shape}"
        raise PointFileError(file, what, f"make it numbers of the shape {shape}, or leave it out")
    return values.astype(np.float64)


def _check(file: Path, found: PointFile, numbers: list[int] | None) -> None:
    count = len(found.points)
    if count == 0:
        raise PointFileError(file, "holds no points", "export it again")
    if count > MOST_POINTS:
        raise PointFileError(file, f"holds {count} points; at most {MOST_POINTS} are read", "leave out some of them")
    bad = np.flatnonzero(~np.isfinite(found.points).all(axis=1))
    if bad.size:
        first = int(bad[0])
        line = numbers[first] if numbers else first + 1
        what = f"{bad.size} of {count} points have a coordinate that is no finite number"
        raise PointFileError(file, what, "leave these points out", line=line)
