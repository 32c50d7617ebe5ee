"""Cramer-Rao bound of a range from a sampled pulse pair (docs/ranging.md)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.instrument.ranging.ranges import RANGE_PER_INTERVAL_MM_PER_PS

FloatArray = NDArray[np.float64]
Signal = Callable[[FloatArray, float], FloatArray]

HALF_STEP_PS = 0.5  # of the numerical derivatives; their errors go with its square over that of the rise time, 6e-6
AMPLITUDE_STEP = 0.01  # of the amplitude


class Pulse(NamedTuple):
    """A pulse: ``signal(t_ps, amplitude_mv)`` in mV at times t after its time-significant point; and both its
    values."""

    signal: Signal
    time_ps: float
    amplitude_mv: float


def range_bound_mm2(
    reference: Pulse,
    echo: Pulse,
    times_ps: ArrayLike,
    variance_mv2: Callable[[FloatArray, FloatArray], FloatArray],
    sweeps: float = 1.0,
) -> float:
    """Return the least variance (mm^2) that an unbiased range can have.

    The samples are ``x_i = b + s_r(t_i) + s_e(t_i) + n_i`` with independent normal noise of variance v_i; unknown are
    delay and amplitude of both pulses and the baseline b. The Fisher information is ``F = sum_i d_i d_i^T / v_i`` with
    d_i the derivatives of the mean of x_i; the bound is ``(c / 2)^2 u^T F^-1 u / sweeps`` with u = -1 and 1 at the two
    delays.

    Parameters
    ----------
    reference, echo : Pulse
    times_ps : (S,) array
        Sampling instants of a sweep (of all windows together).
    variance_mv2 : callable
        Variance of a single sample for signal (mV) and slope (mV/ps).
    sweeps : float
    """
    times = np.asarray(times_ps, dtype=np.float64)
    rows, signal, slope = [], np.zeros_like(times), np.zeros_like(times)
    for pulse in (reference, echo):
        after = times - pulse.time_ps
        value = pulse.signal(after, pulse.amplitude_mv)
        later, earlier = (pulse.signal(after + d, pulse.amplitude_mv) for d in (HALF_STEP_PS, -HALF_STEP_PS))
        rate = (later - earlier) / (2 * HALF_STEP_PS)
        h = AMPLITUDE_STEP * pulse.amplitude_mv
        gain = (pulse.signal(after, pulse.amplitude_mv + h) - pulse.signal(after, pulse.amplitude_mv - h)) / (2 * h)
        rows += [-rate, gain]
        signal, slope = signal + value, slope + rate
    design = np.stack([*rows, np.ones_like(times)])
    information = (design / variance_mv2(signal, slope)) @ design.T
    asked = np.array([-1.0, 0.0, 1.0, 0.0, 0.0])
    return float(RANGE_PER_INTERVAL_MM_PER_PS**2 * asked @ np.linalg.solve(information, asked) / sweeps)
