"""`Cloud`: the points of a whole scan as arrays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.line import LAST_ECHO, NO_RANGE, Flag, LastEcho, ScanLine, beams_to, in_step_of_raster


@dataclass(frozen=True)
class Cloud(LastEcho):
    """All points of a scan, line after line; also those without a range, until `with_range`.

    The last of two echoes has the arrays of `LastEcho`.

    Attributes
    ----------
    points_mm : (N, 3) float array
        Scanner frame; NaN without range.
    covariance_mm2 : (N, 3, 3) float array
    range_mm, range_variance_mm2, response_mv : (N,) float arrays
    flags : (N,) uint16 array
        Sums of `picoradar.instrument.line.scan_line.Flag`.
    rows, columns : (N,) int32 arrays
        Position in the raster.
    angles_rad : (N, 2) float array
        Optical angles that the beam was sent to.
    """

    points_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float64]
    range_mm: NDArray[np.float64]
    range_variance_mm2: NDArray[np.float64]
    response_mv: NDArray[np.float64]
    flags: NDArray[np.uint16]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    angles_rad: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Say that no place has a last echo where none was given."""
        self._one_echo_where_not_given(len(self.flags))

    def __len__(self) -> int:
        return len(self.flags)

    @property
    def has_range(self) -> NDArray[np.bool_]:
        """Get the (N,) mask of points that have a range."""
        return np.asarray((self.flags & np.uint16(NO_RANGE)) == 0, dtype=np.bool_)

    @property
    def flag_counts(self) -> dict[str, int]:
        """Get how many points carry each flag that any carries, by its words."""
        counts = {flag.words: int(np.count_nonzero(self.flags & np.uint16(flag))) for flag in Flag if flag}
        return {words: count for words, count in counts.items() if count}

    @property
    def grid(self) -> NDArray[np.int32]:
        """Get the (N, 2) raster rows and columns."""
        return np.column_stack([self.rows, self.columns])

    @cached_property
    def beams(self) -> NDArray[np.float64]:
        """Get the (N, 3) unit vectors from the scanner's origin to the points; NaN where there is no range."""
        return beams_to(self.points_mm)

    def with_range(self) -> Self:
        """Return the points that have a range."""
        return self.where(self.has_range)

    def where(self, chosen: NDArray[np.bool_]) -> Self:
        """Return the points of an (N,) mask."""
        return type(self)(**{field.name: getattr(self, field.name)[chosen] for field in fields(self)})


def cloud_of(lines: Iterable[ScanLine], *, raster: bool = False) -> Cloud:
    """Join lines to a cloud, in the order of their rows.

    Parameters
    ----------
    lines : iterable of ScanLine
    raster : bool
        Whether rows and columns are neighbours in space. Then points in a step between two surfaces that only the
        next line shows are flagged as `Flag.MIXED`, too.
    """
    found = sorted(lines, key=lambda line: line.index)

    def joined(name: str, shape: tuple[int, ...], kind: type) -> NDArray[np.float64]:
        return np.concatenate([np.empty((0, *shape), dtype=kind), *(getattr(line, name) for line in found)], dtype=kind)

    cloud = Cloud(
        points_mm=joined("points_mm", (3,), np.float64),
        covariance_mm2=joined("covariance_mm2", (3, 3), np.float64),
        range_mm=joined("range_mm", (), np.float64),
        range_variance_mm2=joined("range_variance_mm2", (), np.float64),
        response_mv=joined("response_mv", (), np.float64),
        flags=joined("flags", (), np.uint16).astype(np.uint16),
        rows=np.repeat([line.index for line in found], [len(line.columns) for line in found]).astype(np.int32),
        columns=joined("columns", (), np.int32).astype(np.int32),
        angles_rad=joined("angles_rad", (2,), np.float64),
        **{name: joined(name, shape, np.float64) for name, shape in LAST_ECHO.items()},
    )
    if not raster:
        return cloud
    stepped = in_step_of_raster(cloud.range_mm, cloud.range_variance_mm2, cloud.rows, cloud.columns)
    return replace(cloud, flags=np.where(stepped, cloud.flags | np.uint16(Flag.MIXED), cloud.flags))
