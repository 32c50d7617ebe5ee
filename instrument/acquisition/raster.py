"""`RasterPlan`: evenly spaced points on a plane, line by line.

Every line runs in the same direction, left to right (x increasing), and begins one step to the left of its first
point. A serpentine would save the fly-back, a few milliseconds a line, but reverse the sign of the scanner's lag from
line to line, which shows as a comb in the cloud; and the scanner is 0.5 mm off after the step back to a new line
against 0.1 mm after a step within it (section 2.6.2). So the step back goes to the lead-in, has its own settling time
there, and each measurement point is reached by the same small step from the left.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from picoradar.instrument.acquisition.plan import LinePlan
from picoradar.instrument.calibration import (
    Calibration,
    ScannerErrors,
    angles_and_range,
    angles_to_codes,
    asked_angles,
    codes_to_angles,
)
from picoradar.instrument.controller import Between
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import Settings


@dataclass(frozen=True)
class RasterPlan:
    """Rows and columns of points, evenly spaced on the plane z = distance and centred on the beam at rest.

    Attributes
    ----------
    rows, columns : int
    step_mm : float
        Distance of neighbouring points on that plane.
    distance_mm : float
    field_deg : float
        Analogue span of the scanner.
    separation_mm : float
        Distance of the two mirror axes.
    errors : ScannerErrors
        What the mirrors do differently from what they are asked; compensated.

    Raises
    ------
    BadInput
        When a size is not positive.
    LimitError
        When a corner or a lead-in is outside the scanner's span.
    """

    rows: int
    columns: int
    step_mm: float
    distance_mm: float
    field_deg: float = 10.0
    separation_mm: float = 30.0
    errors: ScannerErrors = field(default_factory=ScannerErrors)

    name: ClassVar[str] = "raster"

    @classmethod
    def of(cls, settings: Settings, calibration: Calibration) -> RasterPlan:
        """Lay the raster of the settings out for a calibrated scanner.

        Raises
        ------
        LimitError
            When it does not fit into the scanner's span.
        """
        scan = settings.scan
        return cls(
            rows=scan.rows,
            columns=scan.columns,
            step_mm=scan.step_mm,
            distance_mm=scan.distance_mm,
            field_deg=settings.scanner.field_deg,
            separation_mm=calibration.mirror_separation_mm,
            errors=calibration.scanner,
        )

    def __post_init__(self) -> None:
        if min(self.rows, self.columns) < 1:
            raise BadInput(f"a raster of {self.rows} x {self.columns} has no points; give at least 1 x 1")
        if not (self.step_mm > 0 and self.distance_mm > 0):
            raise BadInput(
                f"raster step {self.step_mm:g} mm and distance {self.distance_mm:g} mm must both be above 0 mm"
            )
        for row in {0, self.rows // 2, self.rows - 1}:  # x needs its largest angle in the middle, y at the ends
            self.line(row)

    def line(self, row: int) -> LinePlan:
        """Return the plan of one line.

        Raises
        ------
        BadInput
            When there is no such row.
        """
        if not 0 <= row < self.rows:
            raise BadInput(f"row {row} is not in the raster; it has rows 0 to {self.rows - 1}")
        columns = np.arange(-1, self.columns)  # -1 is the lead-in
        points = np.empty((len(columns), 3))
        points[:, 0] = (columns - (self.columns - 1) / 2) * self.step_mm
        points[:, 1] = ((self.rows - 1) / 2 - row) * self.step_mm
        points[:, 2] = self.distance_mm
        wanted, _ = angles_and_range(points, self.separation_mm)
        codes = angles_to_codes(asked_angles(wanted, self.errors), self.field_deg)
        return LinePlan(
            row=row,
            columns=columns[1:].astype(np.int32),
            lead_in=codes[0],
            codes=codes[1:],
            angles_rad=codes_to_angles(codes[1:], self.field_deg),
        )

    def run_id(self, row: int, column: int) -> int:
        """Return the number of a point in the raster, from 1."""
        return row * self.columns + column + 1

    def wait_for(self, row: int, between: Between) -> None:
        """Return at once."""

    def header(self) -> dict[str, float]:
        """Get step and distance, mm."""
        return {"step_mm": self.step_mm, "distance_mm": self.distance_mm}
