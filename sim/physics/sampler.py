"""Sampling bridge and A/D: the instant that each shot samples, and the resulting code."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.receiver import Pulse
from picoradar.sim.physics.spread import TABLE_PS
from picoradar.sim.settings import SimulationSettings

MAX_CODE = 255


def add_pulse(
    signal_mv: NDArray[np.float32], slope: NDArray[np.float32], first_ps: float, step_ps: float, pulse: Pulse
) -> None:
    """Add a pulse to the signal at the sampling instants.

    Parameters
    ----------
    signal_mv, slope : (samples,) arrays
        Signal, and its slope in mV/ps (what jitter turns into noise); changed in place.
    first_ps, step_ps : float
        True instant of the first sample, and step from sample to sample.
    pulse : Pulse
        Begins and ends at zero.
    """
    first = max(0, math.ceil((pulse.begin_ps - first_ps) / step_ps))
    last = min(len(signal_mv), math.ceil((pulse.end_ps - first_ps) / step_ps))
    if first >= last:
        return
    places = np.arange(first, last) * (step_ps / TABLE_PS) + (first_ps - pulse.begin_ps) / TABLE_PS
    entries = places.astype(np.intp)
    places -= entries
    before = pulse.shape.take(entries, mode="clip")
    entries += 1
    rise = pulse.shape.take(entries, mode="clip")
    rise -= before
    slope[first:last] += rise * np.float32(1 / TABLE_PS)
    rise *= places.astype(np.float32)
    before += rise
    signal_mv[first:last] += before


def remember(signal_mv: NDArray[np.float32], share: float, settle_shots: int) -> None:
    """Leave a share of each sample on the hold capacitor for the next one; changes ``signal_mv`` in place.

    What is held before the first sample of a sweep is that sample itself, because the settling shots before it sample
    the same instant; without settling shots it is the last sample of the sweep before, and 0 mV before the first.

    Parameters
    ----------
    signal_mv : (sweeps, samples) float32 array, C order
    share : float
    settle_shots : int
    """
    first = signal_mv[:, 0].copy()
    shots = signal_mv.reshape(-1)
    left = shots[:-1] - shots[1:]
    left *= np.float32(share)
    shots[0] *= np.float32(1 - share)
    shots[1:] += left
    if settle_shots > 0:
        signal_mv[:, 0] = first


def digitise(signal_mv: NDArray[np.float32], settings: SimulationSettings) -> tuple[NDArray[np.uint32], bool]:
    """Turn samples into codes and add up the sweeps.

    The A/D has an offset, and a bow as its integral non-linearity: zero at both ends of the range.

    Parameters
    ----------
    signal_mv : (sweeps, samples) float32 array
    settings : SimulationSettings
        Size of a code, code of 0 V, offset and non-linearity.

    Returns
    -------
    (samples,) uint32 array, bool
        Sums of the codes, and whether any single code is at an end of the range.
    """
    # With x = v / lsb + zero, the code is x + 4 bow x (255 - x) / 255^2: a parabola in v, evaluated by Horner's rule.
    per_mv, zero = 1 / settings.mv_per_code, settings.code_of_zero + settings.adc_offset_codes
    bend = 4 * settings.adc_bow_codes / MAX_CODE**2
    codes = signal_mv * np.float32(-bend * per_mv**2)
    codes += np.float32(per_mv * (1 + bend * (MAX_CODE - 2 * zero)))
    codes *= signal_mv
    codes += np.float32(zero + bend * zero * (MAX_CODE - zero))
    np.rint(codes, out=codes)
    clipped = bool(codes.min() <= 0 or codes.max() >= MAX_CODE)
    if clipped:
        np.clip(codes, 0, MAX_CODE, out=codes)
    # Whole numbers below 2^24: exact in single precision for any number of sweeps that the bridge can take.
    return codes.sum(axis=0).astype(np.uint32), clipped
