"""`Raster`: which places of which lines the beam goes to.

Every line runs in the same direction, left to right (x increasing), and begins one step to the left of its first
place. A serpentine would save the fly-back, a few milliseconds a line, but reverse the sign of the scanner's lag from
line to line, which shows as a comb in the cloud; and the scanner is 0.5 mm off after the step back to a new line
against 0.1 mm after a step within it (S 2.6.2). So the step back goes to the lead-in place, has its own settling time
there, and each measured place is reached by the same small step from the left.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import (
    ScannerErrors,
    angles_and_range,
    angles_to_codes,
    asked_angles,
    codes_to_angles,
)
from picoradar.instrument.errors import BadInput


@dataclass(frozen=True)
class LinePlan:
    """Where the beam goes in one line.

    Attributes
    ----------
    row : int
        Row of the raster; row 0 is the top (y largest).
    columns : (N,) int32 array
        Columns in the order in which they are taken.
    lead_in : (2,) int array
        Codes (x, y) of the place before the first; let the mirrors settle here after the step back.
    codes : (N, 2) int array
        Codes (x, y) of the places.
    angles_rad : (N, 2) float array
        Optical angles of just these codes, as asked for: the scanner's errors are not applied to them.
    """

    row: int
    columns: NDArray[np.int32]
    lead_in: NDArray[np.int64]
    codes: NDArray[np.int64]
    angles_rad: NDArray[np.float64]


@dataclass(frozen=True)
class Raster:
    """Rows and columns of places, evenly spaced on the plane z = distance and centred on the beam at rest.

    Attributes
    ----------
    rows, columns : int
    step_mm : float
        Distance of neighbouring places on that plane.
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
        When a corner or a lead-in place is outside the scanner's span.
    """

    rows: int
    columns: int
    step_mm: float
    distance_mm: float
    field_deg: float = 10.0
    separation_mm: float = 30.0
    errors: ScannerErrors = field(default_factory=ScannerErrors)

    def __post_init__(self) -> None:
        if min(self.rows, self.columns) < 1:
            raise BadInput(f"a raster of {self.rows} x {self.columns} has no places; give at least 1 x 1")
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
