"""`Plan`: where the beam goes, line by line. One class a way to go: `RasterPlan`, `PointsPlan`, `MonitorPlan`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.controller import Between


@dataclass(frozen=True)
class LinePlan:
    """Where the beam goes in one line.

    Attributes
    ----------
    row : int
        Number of the line; in a raster, row 0 is the top (y largest).
    columns : (N,) int32 array
        Columns in the order in which they are taken.
    lead_in : (2,) int array
        Codes (x, y) of the position before the first; let the mirrors settle here after the step back.
    codes : (N, 2) int array
        Codes (x, y) of the points.
    angles_rad : (N, 2) float array
        Optical angles of just these codes, as asked for: the scanner's errors are not applied to them.
    """

    row: int
    columns: NDArray[np.int32]
    lead_in: NDArray[np.int64]
    codes: NDArray[np.int64]
    angles_rad: NDArray[np.float64]


class Plan(Protocol):
    """Lines of measurement points; knows nothing of how a point is sampled."""

    @property
    def name(self) -> str:
        """Get what kind of plan it is, for the recording's header."""

    @property
    def rows(self) -> int:
        """Get the number of lines."""

    @property
    def columns(self) -> int:
        """Get the number of points in a line."""

    @property
    def step_mm(self) -> float | None:
        """Get the distance of neighbouring points and lines; None where neighbours tell nothing: no raster."""

    def line(self, row: int) -> LinePlan:
        """Return the plan of one line."""

    def run_id(self, row: int, column: int) -> int:
        """Return the run id of a point, unlike that of any other; rows from `rows` on are for repeats."""

    def wait_for(self, row: int, between: Between) -> None:
        """Return when a line is due; ``between`` is called meanwhile and may raise."""

    def header(self) -> dict[str, float]:
        """Get what the header of a recording says of it beside rows and columns."""
