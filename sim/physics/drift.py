"""`SlowDrift`: a smooth random drift that depends on the time alone, not on when or how often it is read."""

from __future__ import annotations

import math
from functools import lru_cache

from picoradar.sim.physics.noise import Noise

KNOT_SHARE = 0.5  # knots per correlation time


class SlowDrift:
    """Gaussian noise, smooth over ``correlation_s``.

    Independent Gaussian knots, half a correlation time apart, are joined by the cubic B-spline kernel; its values
    are scaled so that the standard deviation is ``sigma`` at the knots.

    Parameters
    ----------
    noise : Noise
        Streams of the bench.
    name : str
        Name of the source.
    sigma : float
        Standard deviation, in any unit.
    correlation_s : float
        Time over which it changes.
    """

    def __init__(self, noise: Noise, name: str, sigma: float, correlation_s: float) -> None:
        self._noise = noise
        self._name = name
        self._scale = sigma / math.sqrt(0.5)  # (1^2 + 4^2 + 1^2) / 6^2 = 0.5
        self._spacing_s = correlation_s * KNOT_SHARE
        self._knot = lru_cache(maxsize=256)(self._draw)

    def at(self, time_s: float) -> float:
        """Get the drift at a time (s, 0 or later)."""
        place = time_s / self._spacing_s
        first = math.floor(place)
        u = place - first
        weights = ((1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3)
        a, b, c, d = self._knot(first), self._knot(first + 1), self._knot(first + 2), self._knot(first + 3)
        return self._scale / 6 * (weights[0] * a + weights[1] * b + weights[2] * c + weights[3] * d)

    def _draw(self, number: int) -> float:
        return float(self._noise.stream(self._name, number).standard_normal())
