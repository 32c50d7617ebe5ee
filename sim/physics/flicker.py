"""`Flicker`: 1/f noise as a sum of random polygons an octave apart, which can be read at any time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.noise import Noise

FINEST_S = 0.05e-3  # between the corners of the fastest polygon: power up to about 1 / (2 x 0.05 ms) = 10 kHz
OCTAVES = 12  # the slowest has 102 ms between its corners: down to about 5 Hz
BLOCK = 1024  # corners of the fastest polygon that are drawn at once
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
        self._block = lru_cache(maxsize=64)(self._draw)
        self._corners = lru_cache(maxsize=256)(self._draw_corners)

    def of_run(self, run: tuple[int, ...], first_shot: int, shots: int, prf_hz: float) -> NDArray[np.float32]:
        """Get the noise (shots,) from ``first_shot`` of a run (run id, repetition) on."""
        per_shot = 1 / (prf_hz * FINEST_S)
        first, last = int(first_shot * per_shot), int((first_shot + shots) * per_shot) + 1
        blocks = range(first // BLOCK, last // BLOCK + 1)
        parts = [self._block(*run, block) for block in blocks]
        corners = parts[0] if len(parts) == 1 else np.concatenate(parts)
        places = np.arange(first_shot, first_shot + shots) * per_shot - blocks[0] * BLOCK
        entries = places.astype(np.intp)
        places -= entries
        before = corners.take(entries)
        entries += 1
        rise = corners.take(entries, mode="clip")
        rise -= before
        rise *= places.astype(np.float32)
        before += rise
        return before

    def _draw(self, run: int, repeat: int, block: int) -> NDArray[np.float32]:
        """Sum of all polygons at the corners of the fastest one, at some of which all the others turn."""
        total = np.zeros(BLOCK)
        for octave in range(OCTAVES):
            spacing = 2**octave
            if spacing >= BLOCK:  # several blocks share a side
                place = block * BLOCK / spacing + np.arange(BLOCK) / spacing
                first = int(place[0])
                ends = [self._corners(run, repeat, octave, corner)[0] for corner in (first, first + 1)]
                total += np.interp(place, [first, first + 1], ends)
            else:
                here, after = (self._corners(run, repeat, octave, b) for b in (block, block + 1))
                corners = np.append(here, after[0])
                total += np.interp(np.arange(BLOCK) / spacing, np.arange(len(corners)), corners)
        return np.asarray(self._scale * total, dtype=np.float32)

    def _draw_corners(self, run: int, repeat: int, octave: int, block: int) -> NDArray[np.float64]:
        count = max(1, BLOCK // 2**octave)
        return np.asarray(self._noise.stream("bridge.flicker", run, repeat, octave, block).standard_normal(count))
