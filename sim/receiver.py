"""`Receiver`: avalanche photodiode and bridge input, from light to the voltage at the photodiode."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.settings import SimulationSettings

ELECTRON_C = 1.602176634e-19
POLES = 4
RISE_PER_POLE = 4.936  # 10-90 % rise of a step through POLES equal poles, in their time constant
CARRIER_EXPONENT = 0.3  # shape of the collected current, (1 - t/T)^0.3
GRID_PS = 1.0
TABLE_PS = 0.25  # spacing of the tables: nearest entry is good to 1e-3 of a pulse, well below a code
SPAN_PS = 8192
SUPPORT_LEVEL = 1e-5
LEVELS = 33


class PulseTable(NamedTuple):
    """Pulse shapes of unit peak for own rise times from the nominal one up.

    Attributes
    ----------
    shapes : (LEVELS, N) float32 array
        Shape every `TABLE_PS`, first column ``start_ps`` before the centre of the laser pulse.
    widths_ps : (LEVELS,) float array
        Area of each, that is charge over peak current.
    start_ps : float
        Time of the first column (negative).
    """

    shapes: NDArray[np.float32]
    widths_ps: NDArray[np.float64]
    start_ps: float


class Echo(NamedTuple):
    """A pulse at the photodiode: ``shape`` (N,) float32 in mV every `TABLE_PS` from ``start_ps`` on (relative to
    the arrival of the light), its peak ``response_mv``, and ``duration_ps``."""

    shape: NDArray[np.float32]
    start_ps: float
    response_mv: float

    @property
    def duration_ps(self) -> float:
        """Get the time from first to last entry (ps)."""
        return (len(self.shape) - 1) * TABLE_PS


class Receiver:
    """Avalanche photodiode at the sampling bridge (dissertation, sections 2.4 and 2.5).

    The light becomes a current that falls off while the last carriers are collected; the photodiode and the bridge's
    input are four equal poles each; the mismatch between them sends an inverted, delayed copy after the pulse (the
    small overshoot). At small response the photodiode's own rise time grows: the whole edge, with its 50 % point,
    comes later. That is the timing walk.
    """

    def __init__(self, settings: SimulationSettings) -> None:
        self._settings = settings
        self._table = lru_cache(maxsize=32)(self._make_table)

    def charge_fc(self, light_pj: float) -> float:
        """Get the charge (fC) that ``light_pj`` on the photodiode sets free, multiplication included."""
        return light_pj * self._settings.responsivity_a_per_w * self._settings.avalanche_gain * 1e3

    def rise_excess(self, response_mv: float) -> float:
        """Get the relative growth of the photodiode's own rise time at a response."""
        s = self._settings
        exponent = (response_mv - s.slow_rise_response_mv) / s.slow_rise_width_mv
        return s.slow_rise_excess / (1.0 + math.exp(min(exponent, 700.0)))

    def echo(self, charge_fc: float, laser_fwhm_ps: float) -> Echo:
        """Get the pulse that a charge gives.

        Parameters
        ----------
        charge_fc : float
            Charge after multiplication.
        laser_fwhm_ps : float
            Width of the light pulse.
        """
        table = self._table(round(laser_fwhm_ps, 1))
        volts_area = charge_fc * self._settings.load_ohm  # fC x ohm = mV ps
        excess = self.rise_excess(volts_area / float(table.widths_ps[0]))
        place = excess / self._settings.slow_rise_excess * (LEVELS - 1) if excess > 0 else 0.0
        low = min(int(place), LEVELS - 2)
        high_share = place - low
        width_ps = (1 - high_share) * float(table.widths_ps[low]) + high_share * float(table.widths_ps[low + 1])
        response_mv = volts_area / width_ps
        shape = np.float32((1 - high_share) * response_mv) * table.shapes[low]
        shape += np.float32(high_share * response_mv) * table.shapes[low + 1]
        return Echo(shape, table.start_ps, response_mv)

    def reference(self, relative_energy: float, laser_fwhm_ps: float) -> Echo:
        """Get the reference pulse for a laser energy relative to that at 290 V and 23 degC."""
        nominal_mv_ps = self._settings.reference_response_mv * float(self._table(44.0).widths_ps[0])
        return self.echo(relative_energy * nominal_mv_ps / self._settings.load_ohm, laser_fwhm_ps)

    def shot_noise_mv(self, laser_fwhm_ps: float) -> float:
        """Get k (mV) of the shot noise's variance ``k x signal`` (mV^2).

        Electrons arrive at random; each gives the unit response of the receiver, so at a current i the
        variance is 2 q F M i R^2 B with B the noise bandwidth, about 0.35 / rise time.
        """
        s = self._settings
        bandwidth_hz = 0.35e12 / math.hypot(s.photodiode_rise_ps, s.bridge_rise_ps, laser_fwhm_ps * 0.7)
        return 2 * ELECTRON_C * s.excess_noise_factor * s.avalanche_gain * s.load_ohm * bandwidth_hz * 1e3

    def _make_table(self, laser_fwhm_ps: float) -> PulseTable:
        s = self._settings
        lead_ps = math.ceil(1.5 * laser_fwhm_ps)
        t = np.arange(SPAN_PS, dtype=np.float64) * GRID_PS
        light = np.exp(-4 * math.log(2) * ((t - lead_ps) / laser_fwhm_ps) ** 2)
        carriers = np.maximum(1.0 - t / s.carrier_transit_ps, 0.0) ** CARRIER_EXPONENT
        spectrum = np.fft.rfft(light) * np.fft.rfft(carriers)
        omega = 2 * np.pi * np.fft.rfftfreq(SPAN_PS, GRID_PS)
        spectrum *= (1 + 1j * omega * s.bridge_rise_ps / RISE_PER_POLE) ** -POLES
        spectrum *= 1 - s.mismatch_reflection * np.exp(-1j * omega * s.mismatch_delay_ps)
        excess = np.linspace(0.0, s.slow_rise_excess, LEVELS)[:, None]
        own_ps = s.photodiode_rise_ps / RISE_PER_POLE * (1 + excess)
        pulses = np.fft.irfft(spectrum * (1 + 1j * omega * own_ps) ** -POLES, SPAN_PS, axis=1)
        pulses /= pulses.max(axis=1, keepdims=True)
        last = int(np.nonzero(np.abs(pulses).max(axis=0) > SUPPORT_LEVEL)[0][-1]) + 2
        fine = np.arange(0.0, last * GRID_PS, TABLE_PS)
        shapes = np.array([np.interp(fine, t, pulse) for pulse in pulses], dtype=np.float32)
        return PulseTable(shapes, pulses.sum(axis=1) * GRID_PS, -float(lead_ps))
