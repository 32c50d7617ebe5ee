"""`Line`: some measured points, as they come from the instrument."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray

Columns = npt.NDArray[np.integer]


class MeasuredLine(Protocol):
    """What a line needs to have; a line of a scanning instrument has it, whatever else it carries."""

    @property
    def index(self) -> int:
        """Get the row of the raster."""
        ...

    @property
    def columns(self) -> Columns:
        """Get the raster columns (N,)."""
        ...

    @property
    def points_mm(self) -> FloatArray:
        """Get the points (N, 3) in the scanner frame, mm; rows with NaN have no range."""
        ...

    @property
    def covariance_mm2(self) -> FloatArray | None:
        """Get the covariances (N, 3, 3) of the points, where they are known."""
        ...

    @property
    def response_mv(self) -> FloatArray | None:
        """Get the amplitudes (N,) of the echoes, where they are known."""
        ...


@dataclass(frozen=True)
class Line:
    """A line of plain arrays, see `MeasuredLine`.

    Attributes
    ----------
    index : int
        Row of the raster.
    columns : (N,) array of int
    points_mm : (N, 3) array
        Scanner frame; NaN where there is no range.
    covariance_mm2 : (N, 3, 3) array, optional
    response_mv : (N,) array, optional
    """

    index: int
    columns: Columns
    points_mm: FloatArray
    covariance_mm2: FloatArray | None = None
    response_mv: FloatArray | None = None
