"""Sampling bridge and A/D: which instant each shot samples, and the code that comes of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.receiver import TABLE_PS, Pulse
from sim.settings import SimulationSettings

MAX_CODE = 255
JITTER_REACH = 6.0


def add_pulse(
    signal_mv: NDArray[np.float32],
    instants_ps: NDArray[np.float64],
    pulse: Pulse,
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
        True sampling instants, increasing.
    pulse : Pulse
        Begins and ends at zero.
    jitter : numpy.random.Generator
        Stream of the jitter.
    jitter_ps : float
        Standard deviation of the jitter.
    """
    reach_ps = JITTER_REACH * jitter_ps
    first, last = np.searchsorted(instants_ps, (pulse.begin_ps - reach_ps, pulse.end_ps + reach_ps))
    if first == last:
        return
    entries = jitter.standard_normal((signal_mv.shape[0], last - first), dtype=np.float32)
    entries *= np.float32(jitter_ps / TABLE_PS)
    entries += ((instants_ps[first:last] - pulse.begin_ps) / TABLE_PS).astype(np.float32)
    np.rint(entries, out=entries)
    signal_mv[:, first:last] += pulse.shape.take(entries.astype(np.int32), mode="clip")


def digitise(signal_mv: NDArray[np.float32], settings: SimulationSettings) -> tuple[NDArray[np.uint32], bool]:
    """Turn samples into codes and add up the sweeps.

    The A/D has an offset, and a bow as its integral non-linearity: zero at both ends of the range.

    Parameters
    ----------
    signal_mv : (sweeps, samples) float32 array
        Used up as work space.
    settings : SimulationSettings
        Size of a code, code of 0 V, offset and non-linearity.

    Returns
    -------
    (samples,) uint32 array, bool
        Sums of the codes, and whether any single code is at an end of the range.
    """
    codes = signal_mv
    codes *= np.float32(1 / settings.mv_per_code)
    codes += np.float32(settings.code_of_zero + settings.adc_offset_codes)
    if settings.adc_bow_codes:
        bow = np.float32(MAX_CODE) - codes
        bow *= codes
        bow *= np.float32(4 * settings.adc_bow_codes / MAX_CODE**2)
        codes += bow
    np.rint(codes, out=codes)
    clipped = bool(codes.min() <= 0 or codes.max() >= MAX_CODE)
    if clipped:
        np.clip(codes, 0, MAX_CODE, out=codes)
    # Whole numbers below 2^24: exact in single precision for any number of sweeps that the bridge can take.
    return codes.sum(axis=0).astype(np.uint32), clipped
