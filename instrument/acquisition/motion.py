"""`MotionMonitor`: whether the target still stands where it stood, judged by one point that is measured again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.events import JsonObject
from picoradar.instrument.ranging import Ranges

LARGEST_SHARE = 0.02  # of the scan's time that revisits may take
SIGNIFICANT = 5.0  # standard deviations: one false alarm in a million revisits
STEEPEST = 3.0  # mm/mm, 72 degrees of incidence: what is assumed where the distance of neighbours is not known


@dataclass
class MotionMonitor:
    """Monitors one point over a scan.

    The point is chosen in the first line that has a good one: where the range changes least to its neighbours, so that
    an error of the mirrors moves it least. At the end of the next line it is measured for comparison, and from then on
    again at the end of every `interval`-th line. When the two ranges differ by more than their variances and the
    pointing explain, or the echo is gone, the target or the mirrors have moved, and this line and those after it are
    flagged until the target is back.

    Parameters
    ----------
    rows : int
        Lines of the scan.
    revisit_s, line_s : float
        Time that one revisit takes, and one line.
    pointing_sd_mm : float
        Standard deviation of the beam's position on the target, in each direction.

    Attributes
    ----------
    interval : int
        Lines from revisit to revisit, so that these take 2 % of the time. A scan with fewer lines is not monitored.
    moved : bool
        What the last revisit has shown.
    """

    rows: int
    revisit_s: float
    line_s: float
    pointing_sd_mm: float
    moved: bool = False
    _point: tuple[int, int] | None = None
    _slope: float = 0.0
    _first: tuple[float, float] | None = None
    _lines: int = 0
    _seen: tuple[float, float] = field(default=(math.nan, math.nan))

    @property
    def interval(self) -> int:
        """Get the number of lines from one revisit to the next."""
        return math.ceil(self.revisit_s / (LARGEST_SHARE * self.line_s))

    @property
    def point(self) -> tuple[int, int] | None:
        """Get row and column (index in the line) of the point; None before it is chosen."""
        return self._point

    @property
    def seen(self) -> tuple[float, float]:
        """Get where the point showed on the trace (ps) and its response (mV) when it was chosen."""
        return self._seen

    @property
    def due(self) -> bool:
        """Get whether the line that is being taken ends with a revisit."""
        return self._point is not None and (self._first is None or self._lines + 1 >= self.interval)

    def line_done(self, row: int, ranges: Ranges, step_mm: float | None, again: Ranges | None) -> None:
        """Take in a line that is done and, if there was one, the revisit at its end.

        Parameters
        ----------
        row : int
        ranges : Ranges
            Of its points, from side to side.
        step_mm : float or None
            Distance of neighbouring points; None where it is not known.
        again : Ranges or None
            Of the one record of the point.
        """
        self._lines += 1
        if again is not None:
            self._judge(float(again.range_mm[0]), float(again.variance_mm2[0]))
        elif self._point is None and self.rows > self.interval + 1:
            self._choose(row, ranges, step_mm)

    def _choose(self, row: int, ranges: Ranges, step_mm: float | None) -> None:
        good = ranges.flags == 0
        range_mm = np.where(good, ranges.range_mm, np.nan)
        slope = np.abs(_beside(range_mm)).max(axis=0) / (step_mm or 1.0)
        if np.isfinite(slope).any():
            column = int(np.nanargmin(slope))
            self._point = row, column
            self._slope = STEEPEST if step_mm is None else float(slope[column])
            self._seen = float(ranges.echo_ps[column]), float(ranges.response_mv[column])

    def _judge(self, range_mm: float, variance_mm2: float) -> None:
        self._lines = 0
        if self._first is None:
            if math.isfinite(range_mm):
                self._first = range_mm, variance_mm2
            return
        # The slope was seen in one direction only; in the other one it may be as great as one.
        pointing = 2 * (1.0 + self._slope**2) * self.pointing_sd_mm**2
        sd = math.sqrt(variance_mm2 + self._first[1] + pointing)
        self.moved = not abs(range_mm - self._first[0]) <= SIGNIFICANT * sd  # also without an echo

    def state_dict(self) -> JsonObject:
        """Get all that the next lines need to know, as plain data."""
        return {
            "moved": self.moved,
            "place": self._point,
            "slope": self._slope,
            "first": self._first,
            "lines": self._lines,
            "seen": self._seen,
        }

    def load_state(self, state: JsonObject) -> None:
        """Go on from a `state_dict`."""
        self.moved, self._slope, self._lines = state["moved"], state["slope"], state["lines"]
        self._point, self._first = (None if state[name] is None else tuple(state[name]) for name in ("place", "first"))
        self._seen = float(state["seen"][0] or math.nan), float(state["seen"][1] or math.nan)


def _beside(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the steps (2, N) to the left and right neighbour; NaN where there is none."""
    padded = np.pad(values, 1, constant_values=np.nan)
    return np.stack([values - padded[:-2], padded[2:] - values])
