"""`Level`: readings of one gray card."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import Trace
from picoradar.instrument.calibration import Calibration, Method
from picoradar.instrument.line import NO_RANGE
from picoradar.instrument.ranging import estimate

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Level:
    """Readings of one card: reflectance, true distance (mm), and raw traces (R, S)."""

    gray: float
    distance_mm: float
    trace: Trace

    @cached_property
    def traces_mv(self) -> FloatArray:
        """Get the mean traces (R, S), mV."""
        return self.trace.mv

    def ranges(self, method: Method, calibration: Calibration) -> tuple[FloatArray, FloatArray]:
        """Return responses (mV) and range errors (mm) of the readings that have a range."""
        found = estimate(
            self.traces_mv, self.trace.times_ps, method=method, calibration=calibration, sweeps=self.trace.sweeps
        )
        good = (found.flags & np.uint16(NO_RANGE)) == 0
        return found.response_mv[good], found.range_mm[good] - self.distance_mm
