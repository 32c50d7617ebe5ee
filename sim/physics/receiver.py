"""`Receiver`: avalanche photodiode and bridge input, from light to the voltage at the photodiode."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.spread import TABLE_PS, TOGETHER_PS, Late, Shape, Spread, convolved, placed
from picoradar.sim.settings import SimulationSettings

FloatArray = NDArray[np.float64]

ELECTRON_C = 1.602176634e-19
CARRIER_EXPONENT = 0.3  # shape of the collected current, (1 - t/T)^0.3
POLES = 4
RISE_PER_POLE = 4.936  # 10-90 % rise of a step through POLES equal poles, in their time constant
SIGMA_PER_FWHM = 1.0 / math.sqrt(8 * math.log(2))
TAIL_PS = 300.0  # decay of the tail that an ageing diode's pulse grows; chosen
SPAN_PS = 8192
SUPPORT_LEVEL = 2e-4
LEVELS = 33
NOMINAL_FWHM_PS = 44.0
APART_PS = 200.0  # light that arrives later than this counts as a pulse of its own
WALK_COUNTS = 1e-3  # a difference of this in the growth of the own rise time is left out: 0.1 ps
LEAST_SHARE = 1e-3  # less than this of the next level is left out: 0.005 ps


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
    widths_ps: FloatArray
    start_ps: float


class Level(NamedTuple):
    """A response between two shapes of a table: ``share`` of that after ``low``, and its peak ``response_mv``."""

    low: int
    share: float
    response_mv: float


class Pulse(NamedTuple):
    """Voltage at the photodiode: ``shape`` (N,) float32 in mV every `TABLE_PS` from ``begin_ps`` on, with the peak
    ``response_mv``."""

    shape: NDArray[np.float32]
    begin_ps: float
    response_mv: float

    @property
    def end_ps(self) -> float:
        """Get the time of the last entry (ps)."""
        return self.begin_ps + (len(self.shape) - 1) * TABLE_PS


class Receiver:
    """Avalanche photodiode at the sampling bridge (dissertation, sections 2.4 and 2.5).

    The light becomes a current that falls off while the last carriers are collected; the photodiode and the bridge's
    input are four equal poles each; the mismatch between them sends an inverted, delayed copy after the pulse (the
    small overshoot); the sampling gate averages over its aperture. At small response the photodiode's own rise time
    grows: the whole edge, with its 50 % point, comes later. That is the timing walk.
    """

    def __init__(self, settings: SimulationSettings) -> None:
        self._s = settings
        self._table = lru_cache(maxsize=32)(self._make_table)
        self._late_shape = lru_cache(maxsize=1024)(self._make_late_shape)
        bandwidth_hz = 0.35e12 / math.hypot(settings.photodiode_rise_ps, settings.bridge_rise_ps)
        self._shot_noise_a = (
            2 * ELECTRON_C * settings.excess_noise_factor * settings.avalanche_gain**2 * bandwidth_hz
        )  # A^2 for each A of primary current
        background_a = settings.background_nw * 1e-9 * settings.responsivity_a_per_w
        background_mv = 1e3 * settings.load_ohm * math.sqrt(self._shot_noise_a * background_a)
        self.dark_noise_mv = math.hypot(settings.amplifier_noise_mv, background_mv)

    @property
    def shot_noise_mv(self) -> float:
        """Get k (mV) of the shot noise's variance ``k x signal`` (mV^2).

        Electrons arrive at random and are multiplied with an excess noise factor F: the variance of the multiplied
        current is 2 q F M^2 B times the primary one, with the noise bandwidth B about 0.35 / rise time.
        """
        return 1e3 * self._s.load_ohm * self._shot_noise_a / self._s.avalanche_gain

    def charge_fc(self, light_pj: FloatArray) -> FloatArray:
        """Get the charge (fC) that light on the photodiode (pJ) generates, multiplication included."""
        return light_pj * (self._s.responsivity_a_per_w * self._s.avalanche_gain * 1e3)

    def rise_excess(self, response_mv: float) -> float:
        """Get the relative growth of the photodiode's own rise time at a response."""
        exponent = (response_mv - self._s.slow_rise_response_mv) / self._s.slow_rise_width_mv
        return self._s.slow_rise_excess / (1.0 + math.exp(min(exponent, 700.0)))

    def pulses(
        self,
        arrivals_ps: FloatArray,
        charges_fc: FloatArray,
        laser_fwhm_ps: float,
        lates: Sequence[Late] | None = None,
    ) -> list[Pulse]:
        """Get the pulses of the photodiode for light that arrives in several parts.

        Parameters
        ----------
        arrivals_ps, charges_fc : (N,) arrays
            Arrival of each part (centre of the laser pulse) and its charge.
        laser_fwhm_ps : float
            Width of the laser pulse.
        lates : sequence of N Late, optional
            How each part goes on arriving.

        Returns
        -------
        list of Pulse
            One for each group of parts that arrive close together, in order of time.
        """
        order = arrivals_ps.argsort()
        if not charges_fc.all():
            order = order[charges_fc[order] > 0]
        arrivals, charges = arrivals_ps[order], charges_fc[order]
        if len(arrivals) == 0:
            return []
        cuts = (arrivals[1:] - arrivals[:-1] > APART_PS).nonzero()[0] + 1
        bounds = [0, *cuts.tolist(), len(arrivals)]
        if lates is None:
            return [self._group(arrivals[i:j], charges[i:j], laser_fwhm_ps) for i, j in itertools.pairwise(bounds)]
        late = [lates[part] for part in order.tolist()]
        return [
            self._spread_group(arrivals[i:j], charges[i:j], laser_fwhm_ps, late[i:j])
            for i, j in itertools.pairwise(bounds)
        ]

    def reference_charge_fc(self, relative_energy: float) -> float:
        """Get the charge of the reference pulse for a laser energy relative to that at 290 V and 23 degC."""
        widths_ps = self._table(NOMINAL_FWHM_PS).widths_ps
        return relative_energy * self._s.reference_response_mv * float(widths_ps[0]) / self._s.load_ohm

    def _group(self, arrivals_ps: FloatArray, charges_fc: FloatArray, laser_fwhm_ps: float) -> Pulse:
        charge_fc = float(charges_fc.sum())
        start_ps, shape, response_mv = self._response(charge_fc, laser_fwhm_ps)
        if arrivals_ps[-1] - arrivals_ps[0] < TOGETHER_PS:
            return Pulse(shape, float(arrivals_ps @ charges_fc) / charge_fc + start_ps, response_mv)
        first_ps = float(arrivals_ps[0])
        places = (arrivals_ps - first_ps) / TABLE_PS
        together = np.zeros(len(shape) + int(places[-1]) + 1, dtype=np.float32)
        for place, share in zip(places.tolist(), (charges_fc / charge_fc).tolist(), strict=True):
            entry, between = int(place), place % 1.0
            together[entry : entry + len(shape)] += np.float32(share * (1 - between)) * shape
            together[entry + 1 : entry + 1 + len(shape)] += np.float32(share * between) * shape
        return Pulse(together, first_ps + start_ps, float(together.max()))

    def _spread_group(
        self, arrivals_ps: FloatArray, charges_fc: FloatArray, laser_fwhm_ps: float, lates: Sequence[Late]
    ) -> Pulse:
        """Pulse of parts that are spread in time each: the sum of the responses to light that is spread like that."""
        charge_fc = float(charges_fc.sum())
        first_ps, parts = placed(arrivals_ps, charges_fc / charge_fc, lates)
        fwhm_ps = round(laser_fwhm_ps, 1)
        table = self._table(fwhm_ps)
        level = self._level(table, charge_fc)
        together = self._sum(parts, fwhm_ps, level)
        lowered = float(together.max()) / level.response_mv
        # The walk goes by the peak that there is.
        if self.rise_excess(lowered * level.response_mv) > self.rise_excess(level.response_mv) + WALK_COUNTS:
            together = self._sum(parts, fwhm_ps, self._level(table, charge_fc, lowered))
        return Pulse(together, first_ps + table.start_ps, float(together.max()))

    def _sum(self, parts: Mapping[tuple[Spread, int], float], fwhm_ps: float, level: Level) -> Shape:
        """Voltage (mV) of all parts, `placed`, of one charge."""
        levels = [(level.low, (1 - level.share) * level.response_mv)]
        if level.share > LEAST_SHARE:
            levels.append((level.low + 1, level.share * level.response_mv))
        terms = [
            (entry, np.float32(share * peak_mv), self._late_shape(spread, fwhm_ps, number))
            for (spread, entry), share in parts.items()
            for number, peak_mv in levels
        ]
        together = np.zeros(max(entry + len(shape) for entry, _, shape in terms), dtype=np.float32)
        for entry, peak_mv, shape in terms:
            together[entry : entry + len(shape)] += peak_mv * shape
        return together

    def _response(self, charge_fc: float, laser_fwhm_ps: float) -> tuple[float, Shape, float]:
        """Start (ps), shape (mV) and peak (mV) of the response to one charge at time 0."""
        table = self._table(round(laser_fwhm_ps, 1))
        low, share, response_mv = self._level(table, charge_fc)
        shape = np.float32((1 - share) * response_mv) * table.shapes[low]
        shape += np.float32(share * response_mv) * table.shapes[low + 1]
        return table.start_ps, shape, response_mv

    def _make_late_shape(self, spread: Spread, fwhm_ps: float, number: int) -> Shape:
        return convolved(self._table(fwhm_ps).shapes[number], spread)

    def _level(self, table: PulseTable, charge_fc: float, lowered: float = 1.0) -> Level:
        """Where the response to one charge lies in the table.

        Light that is spread in time makes a peak ``lowered`` times as high, after which the own rise time goes.
        """
        volts_area = charge_fc * self._s.load_ohm  # fC x ohm = mV ps
        linear_mv = volts_area / float(table.widths_ps[0])
        volts_area /= math.sqrt(1.0 + (linear_mv / self._s.saturation_mv) ** 2)
        excess = self.rise_excess(lowered * volts_area / float(table.widths_ps[0]))
        place = excess / self._s.slow_rise_excess * (LEVELS - 1) if excess > 0 else 0.0
        low = min(int(place), LEVELS - 2)
        share = place - low
        width_ps = (1 - share) * float(table.widths_ps[low]) + share * float(table.widths_ps[low + 1])
        return Level(low, share, volts_area / width_ps)

    def _make_table(self, laser_fwhm_ps: float) -> PulseTable:
        s = self._s
        lead_ps = math.ceil(1.5 * laser_fwhm_ps)
        t = np.arange(SPAN_PS, dtype=np.float64) * TABLE_PS
        light = np.exp(-4 * math.log(2) * ((t - lead_ps) / laser_fwhm_ps) ** 2)
        if s.tail_ageing > 0:
            tail = np.where(t >= lead_ps, np.exp(-np.maximum(t - lead_ps, 0.0) / TAIL_PS), 0.0)
            light = light * (1 - s.tail_ageing) + tail * (s.tail_ageing * light.sum() / tail.sum())
        carriers = np.maximum(1.0 - t / s.carrier_transit_ps, 0.0) ** CARRIER_EXPONENT
        spectrum = np.fft.rfft(light) * np.fft.rfft(carriers)
        omega = 2 * np.pi * np.fft.rfftfreq(SPAN_PS, TABLE_PS)
        spectrum *= (1 + 1j * omega * s.bridge_rise_ps / RISE_PER_POLE) ** -POLES
        spectrum *= 1 - s.mismatch_reflection * np.exp(-1j * omega * s.mismatch_delay_ps)
        spectrum *= np.exp(-0.5 * (omega * s.aperture_ps * SIGMA_PER_FWHM) ** 2)
        excess = np.linspace(0.0, s.slow_rise_excess, LEVELS)[:, None]
        own_ps = s.photodiode_rise_ps / RISE_PER_POLE * (1 + excess)
        pulses = np.fft.irfft(spectrum * (1 + 1j * omega * own_ps) ** -POLES, SPAN_PS, axis=1)
        pulses /= pulses.max(axis=1, keepdims=True)
        last = int(np.nonzero(np.abs(pulses).max(axis=0) > SUPPORT_LEVEL)[0][-1]) + 2
        shapes = pulses[:, :last].astype(np.float32)
        shapes[:, [0, -1]] = 0.0
        return PulseTable(shapes, pulses.sum(axis=1) * TABLE_PS, -float(lead_ps))
