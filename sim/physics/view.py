"""`View`: what comes back from the spot of one measurement."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.spread import Late


class View(NamedTuple):
    """What comes back from the spot, for each of the N rays that hit.

    Attributes
    ----------
    path_mm : (N,) array
        Path from the diode to the target.
    returned : (N,) array
        Share of the pulse's energy that comes back onto the photodiode.
    range_mm : float
        Range of the beam's axis; NaN where it hits nothing.
    point_mm : (3,) array
        Point where the axis hits, scanner frame.
    angles_rad : (2,) array
        Of the mirrors.
    lates : list of N Late, optional
        How the light of each goes on arriving.
    """

    path_mm: NDArray[np.float64]
    returned: NDArray[np.float64]
    range_mm: float
    point_mm: NDArray[np.float64]
    angles_rad: NDArray[np.float64]
    lates: list[Late] | None

    def seen_again(self, share: float, farther_mm: float) -> View:
        """Add a second path to all light: a share of it, that much farther."""
        return self._replace(
            path_mm=np.concatenate([self.path_mm, self.path_mm + farther_mm]),
            returned=np.concatenate([self.returned, share * self.returned]),
            lates=None if self.lates is None else self.lates + self.lates,
        )
