"""Sampling bridge and A/D: which instant each shot samples, and the code that comes of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.receiver import TABLE_PS, Echo
from sim.settings import SimulationSettings

MAX_CODE = 255


def add_pulse(
    signal_mv: NDArray[np.float32],
    instants_ps: NDArray[np.float64],
    arrival_ps: float,
    echo: Echo,
    jitter: np.random.Generator,
    jitter_ps: float,
) -> None:
    """Add a pulse to what each shot samples.

    Every sample is a shot of its own, so every sample has its own jitter.

    Parameters
    ----------
    signal_mv : (sweeps, samples) float32 array
        Changed in place.
    instants_ps : (samples,) array
        True sampling instants, evenly spaced.
    arrival_ps : float
        Arrival of the light.
    echo : Echo
        The pulse.
    jitter : numpy.random.Generator
        Stream of the jitter.
    jitter_ps : float
        Standard deviation of the jitter.
    """
    begin_ps = arrival_ps + echo.start_ps
    reach_ps = 6 * jitter_ps
    first, last = np.searchsorted(instants_ps, (begin_ps - reach_ps, begin_ps + echo.duration_ps + reach_ps))
    if first == last:
        return
    entries = jitter.standard_normal((signal_mv.shape[0], last - first), dtype=np.float32)
    entries *= np.float32(jitter_ps / TABLE_PS)
    entries += ((instants_ps[first:last] - begin_ps) / TABLE_PS).astype(np.float32)
    # The shape begins and ends at zero, so times outside take the value of its ends.
    signal_mv[:, first:last] += echo.shape.take(np.rint(entries, out=entries).astype(np.int32), mode="clip")


def digitise(signal_mv: NDArray[np.float32], settings: SimulationSettings) -> tuple[NDArray[np.uint32], bool]:
    """Turn samples into codes and add up the sweeps.

    Parameters
    ----------
    signal_mv : (sweeps, samples) float32 array
        Used up as work space.
    settings : SimulationSettings
        Size of a code and code of 0 V.

    Returns
    -------
    (samples,) uint32 array, bool
        Sums of the codes, and whether any single code is at an end of the range.
    """
    signal_mv *= np.float32(1 / settings.mv_per_code)
    signal_mv += np.float32(settings.code_of_zero)
    codes = np.rint(signal_mv, out=signal_mv)
    clipped = bool(codes.min() <= 0 or codes.max() >= MAX_CODE)
    if clipped:
        np.clip(codes, 0, MAX_CODE, out=codes)
    return codes.sum(axis=0, dtype=np.float64).astype(np.uint32), clipped
