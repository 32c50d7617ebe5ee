"""`MarkPlan`: where the beam goes to measure the mark of known range in the field (docs/zero-check.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import Trace
from picoradar.instrument.acquisition.plan import Plan
from picoradar.instrument.calibration import Calibration, ZeroMark, angles_to_codes, asked_angles, codes_to_angles
from picoradar.instrument.line import LineWindows, ZeroReading
from picoradar.instrument.settings import Settings

ROOM_MM = 2.0  # beside the mark, from where on the spot does not touch it


@dataclass(frozen=True)
class MarkPlan:
    """The mark, and the codes (2,) and optical angles (2,), as asked for, at which the beam meets its middle."""

    mark: ZeroMark
    codes: NDArray[np.int64]
    angles_rad: NDArray[np.float64]

    @classmethod
    def of(cls, settings: Settings, calibration: Calibration) -> MarkPlan | None:
        """Plan how to reach the mark of a calibration; None where there is none, or the settings do not want it.

        Raises
        ------
        LimitError
            When it is outside the scanner's span.
        """
        mark = calibration.zero_mark
        if mark is None or not settings.scanner.zero_mark:
            return None
        wanted = np.radians([[mark.x_deg, mark.y_deg]])
        codes = angles_to_codes(asked_angles(wanted, calibration.scanner), settings.scanner.field_deg)
        return cls(mark, codes[0], codes_to_angles(codes, settings.scanner.field_deg)[0])

    @property
    def range_mm(self) -> float:
        """Get the known range of the mark."""
        return self.mark.range_mm

    def stands_in(self, plan: Plan) -> bool:
        """Get whether points of a raster may meet the mark instead of the target behind it."""
        reach_rad = math.atan2(self.mark.side_mm / 2 + ROOM_MM, self.mark.range_mm)
        ends = np.concatenate([plan.line(row).angles_rad[[0, -1]] for row in (0, plan.rows // 2, plan.rows - 1)])
        low, high = ends.min(axis=0) - reach_rad, ends.max(axis=0) + reach_rad
        return bool(((self.angles_rad > low) & (self.angles_rad < high)).all())

    def reading(
        self, began_s: float, *, clipped: NDArray[np.bool_], traces: Trace | None, windows: LineWindows | None
    ) -> ZeroReading:
        """Return what was taken at the mark, for the recording."""
        return ZeroReading(
            self.angles_rad, self.mark.range_mm, self.mark.sd_mm, began_s, clipped, traces=traces, windows=windows
        )
