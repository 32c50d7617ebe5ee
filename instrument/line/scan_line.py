"""`ScanLine`: the only thing that crosses from acquisition to its sinks."""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import Trace
from picoradar.instrument.line.last_echo import LastEcho
from picoradar.instrument.line.windows import LineWindows


class Flag(enum.IntFlag):
    """What is known against a point; several may hold at once. The values are stored in recordings."""

    NONE = 0
    NO_ECHO = 1  # no pulse stands out of the noise after the reference
    LOW_RESPONSE = 2  # an echo, but so weak that the range is doubtful
    CLIPPED = 4  # samples at an end of the A/D: the peak, and with it the 50 % level, is not known
    OVERLAPPED = 8  # reference and echo run into each other
    MIXED = 16  # more than one echo, or an edge or rim under the spot: two surfaces in the footprint
    WALK_EXTRAPOLATED = 32  # response outside the range of the walk calibration
    RETAKEN = 64  # the point was measured again
    MOTION = 128  # target or mirrors have moved since the first lines
    NO_REFERENCE = 256  # the reference pulse is missing: no range at all
    DISTORTED = 512  # a pulse does not have the shape of the calibration: the stated variance is wider for it

    @property
    def words(self) -> str:
        """Get the name as reports and JSON show it, for example ``low response``."""
        return (self.name or "none").lower().replace("_", " ")


NO_RANGE = Flag.NO_ECHO | Flag.NO_REFERENCE
SUSPECT = (
    Flag.LOW_RESPONSE
    | Flag.CLIPPED
    | Flag.OVERLAPPED
    | Flag.MIXED
    | Flag.WALK_EXTRAPOLATED
    | Flag.MOTION
    | Flag.DISTORTED
)


@dataclass(frozen=True)
class ScanLine(LastEcho):
    """One line of the raster, complete: every point of the plan has an entry, also those without an echo.

    Of two echoes at one place that are told apart, points and ranges are of the first; the last one has the arrays of
    `LastEcho`.

    Attributes
    ----------
    index : int
        Row of the raster, from 0.
    columns : (N,) int array
        Raster column of each entry.
    angles_rad : (N, 2) float array
        Optical angles of the two mirrors that the beam was sent to (about x, about y of `calibration.geometry`).
    points_mm : (N, 3) float array
        Points in the scanner frame; NaN where there is no range.
    covariance_mm2 : (N, 3, 3) float array
        Covariance of each point (range, pointing); NaN where there is no range.
    range_mm, range_variance_mm2, response_mv : (N,) float arrays
        Range along the beam (walk corrected), its variance, and amplitude of the echo; NaN where there is none.
    flags : (N,) uint16 array
        Sums of `Flag`.
    traces : Trace or None
        Raw traces (N, S), if they are kept.
    sweeps : int
        Sweeps in each record; the most of any, where they differ.
    device_time_s : float
        Device time (s on the bench's clock) at which the line was begun.
    windows : LineWindows or None
        Raw windows in place of whole traces, if they are kept.
    stretch : (N, 2) float array or None
        How far light from inside the target stretches each echo, and its variance (`unstretched`); NaN where that
        cannot be told, None where the calibration does not say how. The ranges of a line are not corrected by it:
        that takes the other lines.
    """

    index: int
    columns: NDArray[np.int32]
    angles_rad: NDArray[np.float64]
    points_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float64]
    range_mm: NDArray[np.float64]
    range_variance_mm2: NDArray[np.float64]
    response_mv: NDArray[np.float64]
    flags: NDArray[np.uint16]
    traces: Trace | None
    sweeps: int
    device_time_s: float
    windows: LineWindows | None = None
    stretch: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        """Say that no place has a last echo where none was given."""
        self._one_echo_where_not_given(len(self.flags))

    @property
    def has_range(self) -> NDArray[np.bool_]:
        """Get the (N,) mask of entries that carry a point."""
        mask: NDArray[np.bool_] = (self.flags & np.uint16(NO_RANGE)) == 0
        return mask

    @property
    def sums(self) -> NDArray[np.unsignedinteger] | None:
        """Get the (N, S) sums of the raw traces, if they are kept."""
        return None if self.traces is None else self.traces.sums

    @cached_property
    def beams(self) -> NDArray[np.float64]:
        """Get the (N, 3) unit vectors from `ORIGIN_MM` to the points; NaN where there is no range."""
        return beams_to(self.points_mm)

    def without_raw_samples(self) -> ScanLine:
        """Return the line without traces and windows, which are nearly all of its memory."""
        return replace(self, traces=None, windows=None)


ORIGIN_MM = (0.0, 0.0, 0.0)
"""Where the beams come from, in the scanner frame: the axis of the second mirror, which none misses by 3 mm."""


def beams_to(points_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit vectors (N, 3) from `ORIGIN_MM` to points (N, 3) mm; NaN stays NaN."""
    offset = points_mm - np.array(ORIGIN_MM)
    return np.asarray(offset / np.linalg.norm(offset, axis=1)[:, None])
