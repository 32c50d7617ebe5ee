"""`Level`: readings of one gray card."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, Method
from picoradar.instrument.line import NO_RANGE
from picoradar.instrument.ranging import estimate

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Level:
    """Readings of one card: mean traces (R, S) in mV of ``sweeps`` sweeps each, and the card's true distance (mm)."""

    gray: float
    distance_mm: float
    traces_mv: FloatArray
    times_ps: FloatArray
    sweeps: int

    def ranges(self, method: Method, calibration: Calibration) -> tuple[FloatArray, FloatArray]:
        """Return responses (mV) and range errors (mm) of the readings that have a range."""
        found = estimate(self.traces_mv, self.times_ps, method=method, calibration=calibration, sweeps=self.sweeps)
        good = (found.flags & np.uint16(NO_RANGE)) == 0
        return found.response_mv[good], found.range_mm[good] - self.distance_mm
