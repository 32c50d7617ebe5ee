"""`Flicker`: 1/f noise as a sum of random polygons an octave apart, which can be read at any time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.noise import Noise

FINEST_S = 0.05e-3  # between the corners of the fastest polygon: power up to about 1 / (2 x 0.05 ms) = 10 kHz
OCTAVES = 12  # the slowest has 102 ms between its corners: down to about 5 Hz
BLOCK = 64  # corners that are drawn at once
LINE_VARIANCE = 2 / 3  # mean variance of straight lines between independent corners of variance 1


class Flicker:
    """Noise of equal variance in each octave, that is with a power density that falls as 1/f.

    Parameters
    ----------
    noise : Noise
    rms : float
        Of all octaves together, in any unit.
    """

    def __init__(self, noise: Noise, rms: float) -> None:
        self._noise = noise
        self._scale = rms / np.sqrt(LINE_VARIANCE * OCTAVES)
        self._corners = lru_cache(maxsize=1024)(self._draw)

    def of_run(self, run: tuple[int, ...], first_shot: int, shots: int, prf_hz: float) -> NDArray[np.float32]:
        """Get the noise (shots,) from ``first_shot`` of a run (run id, repetition) on."""
        begin = first_shot / prf_hz / FINEST_S
        places = begin + np.arange(shots) / (prf_hz * FINEST_S)
        grid = np.arange(int(begin), int(places[-1]) + 2)  # corners of the fastest polygon; all others turn at some
        total = np.zeros(len(grid))
        for octave in range(OCTAVES):
            coarse = grid / 2**octave
            first, last = int(coarse[0]), int(coarse[-1]) + 1
            blocks = range(first // BLOCK, last // BLOCK + 1)
            corners = np.concatenate([self._corners(*run, octave, block) for block in blocks])
            total += np.interp(coarse - blocks[0] * BLOCK, np.arange(len(corners)), corners)
        return np.asarray(np.interp(places, grid, self._scale * total), dtype=np.float32)

    def _draw(self, *key: int) -> NDArray[np.float64]:
        return self._noise.stream("bridge.flicker", *key).standard_normal(BLOCK)
