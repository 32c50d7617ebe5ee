"""`ZeroReading`: raw records of the mark of known range, by which the range zero is checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import Trace
from picoradar.instrument.line.windows import LineWindows


@dataclass(frozen=True)
class ZeroReading:
    """R records of the mark, taken one after the other at the beginning or the end of a scan.

    Attributes
    ----------
    angles_rad : (2,) float array
        Optical angles that the beam was sent to.
    mark_mm, mark_sd_mm : float
        Range of the mark and its standard deviation, as the calibration had them then.
    device_time_s : float
    clipped : (R,) bool array
        Records in which the device has seen samples at an end of its A/D.
    traces : Trace or None
        Raw (R, S), of a scan of whole traces.
    windows : LineWindows or None
        Raw, of a scan in windows.
    lines : int or None
        Lines that the recording held when it was kept; None before.
    """

    angles_rad: NDArray[np.float64]
    mark_mm: float
    mark_sd_mm: float
    device_time_s: float
    clipped: NDArray[np.bool_]
    traces: Trace | None = None
    windows: LineWindows | None = None
    lines: int | None = None
