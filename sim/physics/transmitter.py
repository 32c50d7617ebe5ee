"""`Transmitter`: from supply voltage and diode temperature to the laser pulse."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from picoradar.sim.settings import SimulationSettings

GAUSS_RISE_PER_FWHM = 0.7164  # 10-90 % rise of a Gaussian pulse
GAUSS_AREA_PER_PEAK_FWHM = math.sqrt(math.pi / math.log(2)) / 2
FALL_PER_RISE_SIGMA = 0.697  # the current falls faster than it rises: 2.39 ns of rise in 2.83 ns of width
RISE_PER_SIGMA = 1.687
HALF_WIDTH_PER_SIGMA = math.sqrt(2 * math.log(2))

CERTAIN_DEVIATIONS = 6.0  # this far from the threshold, either all shots miss it or none
OPERATING_V, OPERATING_DEGC, OPERATING_HZ = 290.0, 23.0, 80e3


class CurrentPulse(NamedTuple):
    """Current through the diode: a Gaussian flank up and a faster one down.

    Attributes
    ----------
    peak_a, fwhm_ns, rise_ns : float
        Peak, width and rise time (10-90 %).
    delay_ns : float
        How much later it comes than at 20 kHz.
    """

    peak_a: float
    fwhm_ns: float
    rise_ns: float
    delay_ns: float

    def at(self, time_ns: float) -> float:
        """Get the current (A) at a time after the peak."""
        sigma_ns = self.rise_ns / RISE_PER_SIGMA * (1.0 if time_ns < 0 else FALL_PER_RISE_SIGMA)
        return self.peak_a * math.exp(-0.5 * (time_ns / sigma_ns) ** 2)


class LaserPulse(NamedTuple):
    """Optical pulse at the diode, Gaussian.

    Attributes
    ----------
    peak_w, fwhm_ps : float
        Peak power and width of the spike.
    delay_ps : float
        Its centre after the trigger.
    energy_noise : float
        Relative standard deviation of its energy from shot to shot.
    misfire_share : float
        Share of the shots that give the long weak pulse of the normal mode instead.
    """

    peak_w: float
    fwhm_ps: float
    delay_ps: float
    energy_noise: float
    misfire_share: float

    @property
    def rise_ps(self) -> float:
        """Get the rise time from 10 to 90 % (ps)."""
        return GAUSS_RISE_PER_FWHM * self.fwhm_ps

    @property
    def energy_pj(self) -> float:
        """Get the energy of one spike (pJ)."""
        return GAUSS_AREA_PER_PEAK_FWHM * self.peak_w * self.fwhm_ps


class Transmitter:
    """Avalanche pulser and single heterostructure diode LD60 (dissertation, sections 2.3 and 2.6.1).

    A capacitor charged to the supply voltage is discharged through the diode. Carriers accumulate until the diode
    lases. If they are injected slowly, the normal mode lases early and clamps the inversion near threshold. If they
    are injected fast, they lower the refractive index so much that the normal mode loses its waveguide; then the
    inversion keeps growing to ``r`` times threshold and ends in one spike, as in a Q-switched laser. More voltage
    injects faster; a warmer diode begins to lase later and so accumulates more, but is less efficient. Below the
    threshold of the spike a shot misfires: the normal mode alone, weak and long.
    """

    def __init__(self, settings: SimulationSettings) -> None:
        self._s = settings
        self.pulse = lru_cache(maxsize=256)(self._pulse)

    def electrical_power_w(self, drive_v: float, prf_hz: float) -> float:
        """Get the mean power (W) that the capacitor takes from the supply, C V^2 f."""
        return self._s.storage_capacitance_pf * 1e-12 * drive_v**2 * prf_hz

    def block_heat_w(self, drive_v: float, prf_hz: float) -> float:
        """Get the mean heat (W) that reaches the diode block.

        Above the power that it has at 300 V and 80 kHz the avalanche transistor no longer recovers between
        shots and conducts in between: the excess heats several times as much.
        """
        power_w = self.electrical_power_w(drive_v, prf_hz)
        excess_w = max(0.0, power_w - self._s.recovery_limit_w)
        return self._s.pulser_heat_share * power_w + self._s.overheating_factor * excess_w

    def junction_degc(self, block_degc: float, drive_v: float, prf_hz: float) -> float:
        """Get the temperature of the junction, which is warmer than the block by the diode's own heat."""
        return block_degc + self._s.junction_k_per_w * self.electrical_power_w(drive_v, prf_hz)

    def current(self, drive_v: float, block_degc: float, prf_hz: float) -> CurrentPulse:
        """Get the current pulse; the charge is that of the capacitor, a warmer junction makes it shorter."""
        warmer_k = self.junction_degc(block_degc, drive_v, prf_hz) - self._operating_junction_degc
        rise_ns = self._s.current_rise_ns * (1.0 - self._s.current_shortening_per_k * warmer_k)
        sigma_ns = rise_ns / RISE_PER_SIGMA
        charge_nc = self._s.storage_capacitance_pf * 1e-3 * drive_v
        peak_a = charge_nc / (math.sqrt(math.pi / 2) * sigma_ns * (1 + FALL_PER_RISE_SIGMA))
        fwhm_ns = HALF_WIDTH_PER_SIGMA * sigma_ns * (1 + FALL_PER_RISE_SIGMA)
        delay_ns = self._s.current_delay_ns_per_w * (
            self.electrical_power_w(drive_v, prf_hz) - self.electrical_power_w(drive_v, 20e3)
        )
        return CurrentPulse(peak_a, fwhm_ns, rise_ns, delay_ns)

    def _pulse(self, drive_v: float, block_degc: float, prf_hz: float = OPERATING_HZ) -> LaserPulse:
        """Get the pulse that follows a trigger.

        Parameters
        ----------
        drive_v : float
            Voltage at the pulser.
        block_degc : float
            Temperature of the diode block, as its sensor sees it.
        prf_hz : float, optional
            Rate of the triggers, for the diode's own heat.
        """
        if drive_v <= self._s.inversion_offset_v:
            return LaserPulse(0.0, self._s.normal_fwhm_ps, self._s.emission_delay_ps, 0.0, 0.0)
        current = self.current(drive_v, block_degc, prf_hz)
        warmer_k = self.junction_degc(block_degc, drive_v, prf_hz) - self._operating_junction_degc
        peak_w, fwhm_ps = self._spike(current.peak_a, warmer_k)
        more_w, more_ps = self._spike(current.peak_a * 1.001, warmer_k)
        gain = math.log(more_w * more_ps / (peak_w * fwhm_ps)) / math.log(1.001)
        sooner = 1.0 - self._volts_to_a(OPERATING_V) / current.peak_a
        delay_ps = self._s.emission_delay_ps - sooner * self._s.gathering_delay_ps
        delay_ps += self._s.delay_ps_per_k * warmer_k + 1e3 * (current.delay_ns - self._lag_ns)
        missing = self._volts_to_a(self._s.misfire_v) / current.peak_a - 1.0
        deviations = missing / max(self._s.current_noise, 1e-6)
        if deviations > CERTAIN_DEVIATIONS:
            return self.misfire(drive_v, delay_ps)
        misfires = 0.0 if deviations < -CERTAIN_DEVIATIONS else 0.5 * math.erfc(-deviations / math.sqrt(2))
        return LaserPulse(peak_w, fwhm_ps, delay_ps, gain * self._s.current_noise, misfires)

    def misfire(self, drive_v: float, delay_ps: float) -> LaserPulse:
        """Get the pulse of the normal mode, long and weak; its power goes as the current above threshold."""
        above = (drive_v - self._s.inversion_offset_v) / (240.0 - self._s.inversion_offset_v)
        return LaserPulse(self._s.normal_peak_w * above, self._s.normal_fwhm_ps, delay_ps, 0.0, 0.0)

    def _spike(self, peak_a: float, warmer_k: float) -> tuple[float, float]:
        """Peak power (W) and width (ps) of the spike."""
        r = self._inversion(peak_a, warmer_k)
        cold_k = self._s.efficiency_offset_k
        efficiency = math.exp((cold_k**2 - max(0.0, warmer_k + cold_k) ** 2) / self._s.efficiency_fall_k**2)
        peak_w = self._s.photon_power_w * efficiency * (r - 1.0 - math.log(r))
        switched_ps = self._s.photon_lifetime_ps * _extracted(r) / (r - 1.0 - math.log(r))
        return peak_w, math.hypot(switched_ps, self._s.spike_floor_ps)

    def _inversion(self, peak_a: float, warmer_k: float) -> float:
        """Inversion over threshold at the moment of the spike."""
        volts = peak_a / self._volts_to_a(1.0)
        gathered = -math.expm1(-(warmer_k + self._s.gathering_offset_k) / self._s.gathering_k)
        gathered /= -math.expm1(-self._s.gathering_offset_k / self._s.gathering_k)
        free = (
            self._s.free_inversion * (volts - self._s.inversion_offset_v) / (OPERATING_V - self._s.inversion_offset_v)
        )
        # A warmer diode lases later and gathers more: it acts like one driven harder.
        fast_v = volts + self._s.suppression_v_per_k * warmer_k
        suppressed = 1.0 / (1.0 + math.exp(-(fast_v - self._s.suppression_v) / self._s.suppression_width_v))
        clamped = 1.0 + (self._s.clamped_inversion - 1.0) * (max(fast_v, 1.0) / self._s.suppression_v) ** 2
        return clamped + max(0.0, free * max(gathered, 0.0) - clamped) * suppressed

    def _volts_to_a(self, drive_v: float) -> float:
        """Peak current at the operating temperature and rate."""
        sigma_ns = self._s.current_rise_ns / RISE_PER_SIGMA
        charge_nc = self._s.storage_capacitance_pf * 1e-3 * drive_v
        return charge_nc / (math.sqrt(math.pi / 2) * sigma_ns * (1 + FALL_PER_RISE_SIGMA))

    @property
    def _operating_junction_degc(self) -> float:
        return self.junction_degc(OPERATING_DEGC, OPERATING_V, OPERATING_HZ)

    @property
    def _lag_ns(self) -> float:
        step_w = self.electrical_power_w(OPERATING_V, OPERATING_HZ) - self.electrical_power_w(OPERATING_V, 20e3)
        return self._s.current_delay_ns_per_w * step_w


def _extracted(r: float) -> float:
    """Inversion that a Q-switched spike takes, in thresholds: r - r_f with r_f - ln r_f = r - ln r, r_f < 1."""
    from scipy.special import lambertw

    return float(r + lambertw(-r * math.exp(-r)).real)
