"""`Speckle`: the grain of laser light, which weights each ray of the spot; frozen to its place."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.footprint import OFFSETS
from picoradar.sim.physics.noise import Noise
from picoradar.sim.settings import SimulationSettings

LEAST_PITCH_MM = 1.0  # of a spot without a diameter
BLOCK = 8  # corners on each side of the blocks that are drawn at once


class Speckle:
    """Factor of unit mean (log-normal) for each ray, as a function of where the beam points.

    Independent Gaussian numbers stand at the corners of a lattice as wide as the spot; between them they are
    interpolated and scaled to variance 1. The rays of one spot are independent, each with a contrast larger by the root
    of their number, so that the whole response has the stated contrast.

    Parameters
    ----------
    settings : SimulationSettings
    noise : Noise
    """

    def __init__(self, settings: SimulationSettings, noise: Noise) -> None:
        self._noise = noise
        self._contrast = settings.speckle_contrast
        self._per_rad = settings.distance_mm / (settings.spot_diameter_mm or LEAST_PITCH_MM)
        self._block = lru_cache(maxsize=1024)(self._draw)

    def factors(self, angles_rad: NDArray[np.float64], rays: int) -> NDArray[np.float64]:
        """Get the factor of each ray (rays,) for optical angles (2,)."""
        if self._contrast == 0:
            return np.ones(rays)
        x, y = (float(angle) * self._per_rad for angle in angles_rad)
        i, j = math.floor(x), math.floor(y)
        u, v = x - i, y - j
        a, b, c, d = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
        grain = a * self._corner(i, j) + b * self._corner(i + 1, j)
        grain += c * self._corner(i, j + 1) + d * self._corner(i + 1, j + 1)
        variance = math.log1p(rays * self._contrast**2)
        grain *= math.sqrt(variance / (a * a + b * b + c * c + d * d))
        grain -= variance / 2
        return np.exp(grain[:rays])

    def _corner(self, i: int, j: int) -> NDArray[np.float64]:
        row: NDArray[np.float64] = self._block(i // BLOCK, j // BLOCK)[i % BLOCK, j % BLOCK]
        return row

    def _draw(self, i: int, j: int) -> NDArray[np.float64]:
        return self._noise.stream("scene.speckle", i, j).standard_normal((BLOCK, BLOCK, len(OFFSETS)))
