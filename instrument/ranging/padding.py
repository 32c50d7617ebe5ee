"""Traces that are shorter than the array that holds them: their ends, which are NaN, filled with their own baseline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def with_ends_filled(traces: FloatArray, first: int) -> FloatArray:
    """Return traces (R, S) whose NaN at the end are replaced by the trace's own first samples, over and over.

    These lie before the first pulse, so they have the level and the noise of the baseline; a constant would look like a
    trace without noise. A trace with NaN elsewhere, or with fewer samples than ``first``, stays as it is.

    Parameters
    ----------
    traces : (R, S) float array
    first : int
        How many samples; 0: nothing is filled.
    """
    missing = np.isnan(traces)
    if first <= 0 or not missing.any():
        return traces
    lengths = traces.shape[1] - np.argmin(missing[:, ::-1], axis=1)
    filled = traces.copy()
    for k in np.flatnonzero(missing[:, -1] & (lengths >= first) & ~missing.all(axis=1)):
        filled[k, lengths[k] :] = np.resize(traces[k, :first], traces.shape[1] - lengths[k])
    return filled
