"""Scans of any places, and of one place over hours: jobs for the controller."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Galvo, Sampler
from picoradar.instrument.acquisition import LinePlan, RasterScan
from picoradar.instrument.calibration import Calibration, codes_to_angles
from picoradar.instrument.controller import Between
from picoradar.instrument.line import ScanLine
from picoradar.instrument.settings import Settings, override

WATCH_LOOK_S = 10.0  # from one look at the interlocks to the next while waiting with the laser on


class PlacesScan(RasterScan):
    """Any places instead of a raster: ``codes`` (rows, columns, 2) of the scanner; lines begin at their first place."""

    def __init__(self, settings: Settings, calibration: Calibration, clock: Clock, codes: NDArray[np.int64]) -> None:
        super().__init__(override(settings, {"scan": {"step_mm": 0.01}}), calibration, clock)
        self._codes = codes
        self.raster = self  # type: ignore[assignment]

    def line(self, row: int) -> LinePlan:
        """Return the plan of one line."""
        codes = self._codes[row]
        return LinePlan(
            row=row,
            columns=np.arange(len(codes), dtype=np.int32),
            lead_in=codes[0],
            codes=codes,
            angles_rad=codes_to_angles(codes, self.settings.scanner.field_deg),
        )


class WatchScan(PlacesScan):
    """Lines at intervals (s) with the laser on all the time; run ids go on as if records had been taken throughout."""

    def __init__(
        self,
        settings: Settings,
        calibration: Calibration,
        clock: Clock,
        codes: NDArray[np.int64],
        interval_s: float,
    ) -> None:
        super().__init__(settings, calibration, clock, codes)
        self._interval_s = interval_s
        record_s = self.sweep.averages * (self.sweep.samples + self.sweep.settle_shots) / self.sweep.prf_hz
        self._records_a_line = max(int(interval_s / record_s), int(codes.shape[1]))
        self._next_s = clock.now()

    def run_id(self, row: int, column: int) -> int:
        """Get the run id of a place."""
        return row * self._records_a_line + column + 1

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:
        """Wait for the line's time, then take it; looks at the interlocks meanwhile."""
        if row > 0:
            while (left_s := self._next_s - self.clock.now()) > 0:
                between()
                self.clock.sleep(min(left_s, WATCH_LOOK_S))
        else:
            self._next_s = self.clock.now()
        self._next_s += self._interval_s
        return super().take_line(row, galvo, sampler, between)
