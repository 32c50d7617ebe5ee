"""`Row`: what the next line of a raster needs to know of the last one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.events import JsonObject
from picoradar.instrument.ranging import LineBefore


@dataclass(frozen=True)
class Row:
    """The last line of a raster."""

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
