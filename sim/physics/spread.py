"""`Spread`: how the light of one part of the echo goes on arriving; parts on one grid, and pulses after such light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Shape = NDArray[np.float32]

TABLE_PS = 1.0  # straight lines between entries are good to 1e-4 of a pulse, well below a code
TOGETHER_PS = 10.0  # light that arrives within this counts as simultaneous: 0.2 % of rise time
STEPS = 5  # entries between the arrivals on the grid: at most 2.5 ps (rms) are added to a pulse that rises in 210 ps
GRID_PS = STEPS * TABLE_PS
LENGTHS = 512  # lengths of the transform are multiples of this, which are products of small primes


@dataclass(frozen=True, eq=False)
class Spread:
    """How light goes on arriving: shares (K,) float32 of sum 1, every `TABLE_PS` from its arrival on.

    Two are equal when they are the same object, so that what is made of one can be kept under it.
    """

    shares: Shape


AT_ONCE = Spread(np.ones(1, dtype=np.float32))


class Late(NamedTuple):
    """Light of one ray: the share ``at_once`` of it, and the rest ``spread``."""

    at_once: float
    spread: Spread


def placed(
    arrivals_ps: FloatArray, shares: FloatArray, lates: Sequence[Late]
) -> tuple[float, dict[tuple[Spread, int], float]]:
    """Put light that arrives at any time onto a grid, each part as two of the same mean.

    Parameters
    ----------
    arrivals_ps : (N,) array
        Arrival of each ray's light, in order of time.
    shares : (N,) array
        Share of each in all light.
    lates : sequence of N Late

    Returns
    -------
    float, dict
        Time of entry 0, ps, and the share of what is spread in one way from one entry on.
    """
    first_ps = float(arrivals_ps[0])
    if arrivals_ps[-1] - first_ps < TOGETHER_PS:
        return float(arrivals_ps @ shares) / float(shares.sum()), _by_spread(0, shares.tolist(), lates)
    places = (arrivals_ps - first_ps) / GRID_PS
    parts: dict[tuple[Spread, int], float] = {}
    for number in range(int(places[-1]) + 2):
        near = shares * np.maximum(1.0 - np.abs(places - number), 0.0)
        parts.update(_by_spread(number * STEPS, near.tolist(), lates))
    return first_ps, parts


def _by_spread(entry: int, shares: list[float], lates: Sequence[Late]) -> dict[tuple[Spread, int], float]:
    """Light that is spread in one way each, from one entry on."""
    sums = {AT_ONCE: 0.0}
    for share, (at_once, spread) in zip(shares, lates, strict=True):
        sums[AT_ONCE] += share * at_once
        sums[spread] = sums.get(spread, 0.0) + share * (1 - at_once)
    return {(spread, entry): share for spread, share in sums.items() if share > 0}


def convolved(shape: Shape, spread: Spread) -> Shape:
    """Get a pulse (N,) whose light is spread over K entries as (N + K - 1,) float32; zero at both ends as ``shape``.

    The ends are set to zero exactly: what the Fourier transform leaves there is rounding.
    """
    if len(spread.shares) == 1:
        return np.asarray(shape * spread.shares[0], dtype=np.float32)
    length = len(shape) + len(spread.shares) - 1
    padded = -(-length // LENGTHS) * LENGTHS
    product = np.fft.rfft(shape, padded)
    product *= np.fft.rfft(spread.shares, padded)
    together = np.fft.irfft(product, padded)[:length].astype(np.float32)
    together[0] = together[-1] = 0.0
    return together
