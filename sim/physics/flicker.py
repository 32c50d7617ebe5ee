"""`flicker`: 1/f noise as a sum of random polygons an octave apart, in a closed loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FINEST_S = 0.05e-3  # between the corners of the fastest polygon: zero of its spectrum at 1 / 0.05 ms = 20 kHz
OCTAVES = 12  # the slowest has 102 ms between its corners: a density of 1/f from about 5 Hz to 2 kHz
SLOWEST_CORNERS = 125  # of the slowest polygon: the loop has whole periods of 50 Hz and of 60 Hz
CORNERS = SLOWEST_CORNERS * 2 ** (OCTAVES - 1)
LOOP_S = CORNERS * FINEST_S  # 12.8 s
LINE_VARIANCE = 2 / 3  # mean variance of straight lines between independent corners of variance 1
PIECE = 2**14  # shots that are calculated at once, in the processor's cache


def flicker(rng: np.random.Generator, rms: float, shots: int) -> NDArray[np.float32]:
    """Draw noise of equal variance in each octave, that is with a power density that falls as 1/f.

    Parameters
    ----------
    rng : numpy.random.Generator
    rms : float
        Of all octaves together, in any unit.
    shots : int
        Number of shots in the loop of `LOOP_S`.

    Returns
    -------
    (shots,) float32 array
        The noise at each shot; the first follows the last.
    """
    total = np.zeros(SLOWEST_CORNERS, dtype=np.float32)
    for octave in range(OCTAVES):
        if octave > 0:
            finer = np.repeat(total, 2)
            finer[1::2] += np.roll(total, -1)
            finer[1::2] *= np.float32(0.5)
            total = finer
        total += rng.standard_normal(len(total), dtype=np.float32)
    total *= np.float32(rms / np.sqrt(LINE_VARIANCE * OCTAVES))
    return _at_shots(np.append(total, total[0]), shots)


def _at_shots(heights: NDArray[np.float32], shots: int) -> NDArray[np.float32]:
    """Points on the polygon through evenly spaced corners."""
    rises = np.diff(heights)
    noise = np.empty(shots, dtype=np.float32)
    for first in range(0, shots, PIECE):
        places = np.arange(first, min(first + PIECE, shots)) * (len(rises) / shots)
        corners = places.astype(np.intp)
        places -= corners
        noise[first : first + PIECE] = heights.take(corners) + rises.take(corners) * places.astype(np.float32)
    return noise
