"""`Cloud`: the points of a whole scan as arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import (
    LAST_ECHO,
    NO_RANGE,
    Flag,
    LastEcho,
    ScanLine,
    StretchTerms,
    Unstretched,
    beams_to,
    in_step_of_raster,
    unstretched,
)


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
    stretch : (N, 2) float array or None
        How far light from inside the target stretches each echo, and its variance; NaN or None where it is not known.
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
    stretch: NDArray[np.float64] | None = None

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
        there = [field.name for field in fields(self) if getattr(self, field.name) is not None]
        return type(self)(**{name: getattr(self, name)[chosen] for name in there})


def cloud_of(lines: Iterable[ScanLine], *, raster: bool = False, stretch: Mapping[str, float] | None = None) -> Cloud:
    """Join lines to a cloud, in the order of their rows.

    Parameters
    ----------
    lines : iterable of ScanLine
    raster : bool
        Whether rows and columns are neighbours in space. Then points in a step between two surfaces that only the
        next line shows are flagged as `Flag.MIXED`, too, and ranges are corrected for the stretch of their echoes.
    stretch : mapping, optional
        Terms of that correction (`StretchTerms`), from the header of the recording.
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
        stretch=_stretch(found),
    )
    if not raster:
        return cloud
    if (correction := _correction(cloud, stretch)) is not None:
        cloud = _corrected(cloud, correction)
    stepped = in_step_of_raster(cloud.range_mm, cloud.range_variance_mm2, cloud.rows, cloud.columns)
    return replace(cloud, flags=np.where(stepped, cloud.flags | np.uint16(Flag.MIXED), cloud.flags))


def range_error_left(known: JsonObject, cloud: Cloud, stretch: Mapping[str, float] | None) -> JsonObject:
    """Return what is known of the range error that all points of a raster share, with what their echoes tell of it.

    Parameters
    ----------
    known : dict
        Before the scan: material, bias_mm, sd_mm.
    cloud : Cloud
    stretch : mapping or None
        Terms of the correction (`StretchTerms`).
    """
    correction = _correction(cloud, stretch)
    if correction is None:
        return known
    seen = {"stretch": correction.stretch, "stretch_sd": correction.stretch_sd}
    return {**known, "sd_mm": correction.sd_mm, **seen}


def range_error_in(header: JsonObject, cloud: Cloud) -> JsonObject:
    """Return material, bias_mm and sd_mm of the range error that all points of a recording share, and their stretch if
    it was seen; empty of recordings of earlier versions.

    Parameters
    ----------
    header : dict
        Of the recording.
    cloud : Cloud
        All its points.
    """
    is_raster = header["raster"].get("step_mm") is not None
    return range_error_left(header.get("range_error") or {}, cloud, header.get("stretch") if is_raster else None)


def _stretch(lines: list[ScanLine]) -> NDArray[np.float64] | None:
    """Join the stretch of the echoes of lines, of which some know it; None where none does."""
    if all(line.stretch is None for line in lines):
        return None
    return np.concatenate(
        [np.full((len(line.columns), 2), np.nan) if line.stretch is None else line.stretch for line in lines]
    )


def _correction(cloud: Cloud, stretch: Mapping[str, float] | None) -> Unstretched | None:
    if stretch is None or cloud.stretch is None:
        return None
    share, variance = cloud.stretch.T
    return unstretched(StretchTerms.of(stretch), share, variance, cloud.rows, cloud.columns)


def _corrected(cloud: Cloud, by: Unstretched) -> Cloud:
    """Move the points along their beams."""
    along = cloud.beams
    variance_mm2 = by.variance_mm2 + by.place_variance_mm2
    return replace(
        cloud,
        points_mm=cloud.points_mm + by.change_mm[:, None] * along,
        covariance_mm2=cloud.covariance_mm2 + variance_mm2[:, None, None] * along[:, :, None] * along[:, None, :],
        range_mm=cloud.range_mm + by.change_mm,
        range_variance_mm2=cloud.range_variance_mm2 + by.variance_mm2,
    )
