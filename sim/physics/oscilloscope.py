"""Channel of a fast oscilloscope: its noise and its codes, the same for all that is wired to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NOISE_MV = 0.3  # standard deviation of a sample; chosen
ZERO_CODE, MV_PER_CODE, MAX_CODE = 32.0, 0.5, 255


def coded(signal_mv: NDArray[np.float64]) -> tuple[NDArray[np.uint32], bool]:
    """Get the sums (S,) of the codes over the sweeps of a signal (K, S) in mV, and whether any was clipped."""
    codes = np.rint(signal_mv / MV_PER_CODE + ZERO_CODE)
    clipped = bool((codes < 0).any() or (codes > MAX_CODE).any())
    return np.asarray(np.clip(codes, 0, MAX_CODE).sum(axis=0), dtype=np.uint32), clipped
