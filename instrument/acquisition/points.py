"""Plans that are no raster: any measurement points, one after the other, or the same ones again and again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.instrument.acquisition.plan import LinePlan
from picoradar.instrument.calibration import codes_to_angles
from picoradar.instrument.controller import Between

POLL_S = 10.0  # from one poll of the interlocks to the next while the laser is on and no line is due


@dataclass(frozen=True)
class PointsPlan:
    """Any measurement points; one point many times over is a fixed-point acquisition.

    Attributes
    ----------
    codes : (rows, columns, 2) int array
        Of the scanner. A line is begun at its first point.
    field_deg : float
        Analogue span of the scanner.
    """

    codes: NDArray[np.int64]
    field_deg: float

    name: ClassVar[str] = "points"
    step_mm: ClassVar[float | None] = None

    @property
    def rows(self) -> int:
        """Get the number of lines."""
        return len(self.codes)

    @property
    def columns(self) -> int:
        """Get the number of points in a line."""
        return int(self.codes.shape[1])

    def line(self, row: int) -> LinePlan:
        """Return the plan of one line."""
        codes = self.codes[row]
        return LinePlan(
            row=row,
            columns=np.arange(len(codes), dtype=np.int32),
            lead_in=codes[0],
            codes=codes,
            angles_rad=codes_to_angles(codes, self.field_deg),
        )

    def run_id(self, row: int, column: int) -> int:
        """Return the number of a point, from 1."""
        return row * self.columns + column + 1

    def wait_for(self, row: int, between: Between) -> None:
        """Return at once."""

    def header(self) -> dict[str, float]:
        """Get nothing: there is no raster."""
        return {}


class MonitorPlan:
    """Lines of some measurement points at intervals, with the laser on all the time.

    Run ids go on as if records had been taken throughout.

    Parameters
    ----------
    points : PointsPlan
        One line for each interval.
    interval_s : float
    record_s : float
        How long one record takes.
    clock : Clock
    """

    name = "monitor"
    step_mm: float | None = None

    def __init__(self, points: PointsPlan, interval_s: float, record_s: float, clock: Clock) -> None:
        self._points = points
        self._interval_s = interval_s
        self._records_a_line = max(int(interval_s / record_s), points.columns)
        self._clock = clock
        self._next_s = clock.now()

    @property
    def rows(self) -> int:
        """Get the number of lines."""
        return self._points.rows

    @property
    def columns(self) -> int:
        """Get the number of points in a line."""
        return self._points.columns

    def line(self, row: int) -> LinePlan:
        """Return the plan of one line."""
        return self._points.line(row)

    def run_id(self, row: int, column: int) -> int:
        """Return the number that a record has if there are records all the time, from 1."""
        return row * self._records_a_line + column + 1

    def wait_for(self, row: int, between: Between) -> None:
        """Wait until the line's interval is over; the first line is due at once, and sets the times of the others."""
        if row == 0:
            self._next_s = self._clock.now()
        while (left_s := self._next_s - self._clock.now()) > 0:
            between()
            self._clock.sleep(min(left_s, POLL_S))
        self._next_s += self._interval_s

    def header(self) -> dict[str, float]:
        """Get the interval."""
        return {"interval_s": self._interval_s}
