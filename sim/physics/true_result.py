"""`Truth`: what a measurement would give without any error, for tests and reports of the simulation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Truth(NamedTuple):
    """The true result of one measurement.

    Attributes
    ----------
    range_mm : float
        Along the axis of the beam from mirror 1's axis to the target, less the mirror separation; inf where it misses.
    response_mv : float
        Peak of the strongest echo at the photodiode; 0 without one.
    angles_rad : (2,) float array
        Optical angles of the two mirrors.
    point_mm : (3,) float array
        Where the axis of the beam hits the target (scanner frame); NaN where it misses.
    """

    range_mm: float
    response_mv: float
    angles_rad: NDArray[np.float64]
    point_mm: NDArray[np.float64]
