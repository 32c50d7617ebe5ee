"""Light that arrives at the photodiode in parts, each spread in time, on one grid; and pulses convolved with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Spread = NDArray[np.float32]

TABLE_PS = 1.0  # straight lines between entries are good to 1e-4 of a pulse, well below a code
TOGETHER_PS = 10.0  # light that arrives within this counts as simultaneous: 0.2 % of rise time
LENGTHS = 512  # lengths of the transform are multiples of this, which are products of small primes


def arriving(arrivals_ps: FloatArray, shares: FloatArray, spreads: Sequence[Spread]) -> tuple[float, Spread]:
    """Get the light of all parts together.

    Parameters
    ----------
    arrivals_ps : (N,) array
        Arrival of each part, in order of time.
    shares : (N,) array
        Share of the light of each.
    spreads : sequence of N (K,) float32 arrays
        How each part goes on arriving, every `TABLE_PS`; of sum 1.

    Returns
    -------
    float, (M,) float32 array
        Time of the first entry, ps, and shares of sum 1 every `TABLE_PS`.
    """
    if arrivals_ps[-1] - arrivals_ps[0] < TOGETHER_PS:
        first_ps = float(arrivals_ps @ shares)
        if all(spread is spreads[0] for spread in spreads):
            return first_ps, spreads[0]
        arrivals_ps = np.full_like(arrivals_ps, first_ps)
    first_ps = float(arrivals_ps[0])
    places = ((arrivals_ps - first_ps) / TABLE_PS).tolist()
    light = np.zeros(int(places[-1]) + 1 + max(len(spread) for spread in spreads), dtype=np.float32)
    for place, share, spread in zip(places, shares.tolist(), spreads, strict=True):
        entry, between = int(place), place % 1.0
        light[entry : entry + len(spread)] += np.float32(share * (1 - between)) * spread
        if between > 0:
            light[entry + 1 : entry + 1 + len(spread)] += np.float32(share * between) * spread
    return first_ps, light


def convolved(shape: Spread, light: Spread) -> Spread:
    """Get a pulse (N,) after light (M,) as (N + M - 1,) float32, by Fourier transform; zero at both ends as ``shape``.

    The ends are set to zero exactly: what the transform leaves there is rounding.
    """
    if len(light) == 1:
        return np.asarray(shape * light[0], dtype=np.float32)
    length = len(shape) + len(light) - 1
    padded = -(-length // LENGTHS) * LENGTHS
    product = np.fft.rfft(shape, padded)
    product *= np.fft.rfft(light, padded)
    together = np.fft.irfft(product, padded)[:length].astype(np.float32)
    together[0] = together[-1] = 0.0
    return together
