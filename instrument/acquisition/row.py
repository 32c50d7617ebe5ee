"""`Row` and `TakenRows`: what a line of a raster needs to know of those beside it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.acquisition.order import LineOrder
from picoradar.instrument.events import JsonObject
from picoradar.instrument.ranging import LineBefore


@dataclass(frozen=True)
class Row:
    """A line of a raster."""

    row: int
    ranges: LineBefore

    def state_dict(self) -> JsonObject:
        """Get it as plain data."""
        return {
            "row": self.row,
            "range_mm": self.ranges.range_mm.tolist(),
            "variance_mm2": self.ranges.variance_mm2.tolist(),
        }

    @classmethod
    def from_state(cls, state: JsonObject) -> Row:
        """Make it of a `state_dict`."""
        range_mm = np.array(state["range_mm"], dtype=np.float64)
        # Recordings of earlier versions have no variances: without them, the noise of that line is left out.
        known = state.get("variance_mm2")
        variance_mm2: NDArray[np.float64] = np.zeros_like(range_mm) if known is None else np.array(known, np.float64)
        return cls(state["row"], LineBefore(range_mm, variance_mm2))


@dataclass
class TakenRows:
    """The ranges of the lines so far.

    Attributes
    ----------
    order : LineOrder
    ranges : dict of int to LineBefore
    """

    order: LineOrder
    ranges: dict[int, LineBefore] = field(default_factory=dict)

    def add(self, row: Row) -> None:
        """Take a line in."""
        self.ranges[row.row] = row.ranges

    def beside(self, row: int) -> Row | None:
        """Return a neighbour of a row that was taken before it; None where there is none."""
        return next((Row(near, self.ranges[near]) for near in self.order.beside(row) if near in self.ranges), None)

    def beside_next(self, row: int) -> Row | None:
        """Return the neighbour of the row after this one; where it has none, this one."""
        following = self.order.next_after(row)
        found = None if following is None else self.beside(following)
        return Row(row, self.ranges[row]) if found is None and row in self.ranges else found
