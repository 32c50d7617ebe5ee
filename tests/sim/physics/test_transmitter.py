"""Laser pulse at the dissertation's operating points."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.sim.physics import Transmitter
from picoradar.sim.settings import SimulationSettings


@pytest.fixture
def transmitter() -> Transmitter:
    return Transmitter(SimulationSettings())


def test_pulse_at_the_operating_point(transmitter):
    pulse = transmitter.pulse(290.0, 23.0)
    assert pulse.peak_w == pytest.approx(128.2, abs=2.0)
    assert pulse.fwhm_ps == pytest.approx(44.0, abs=2.0)
    assert pulse.rise_ps == pytest.approx(32.0, abs=2.0)
    assert pulse.delay_ps == pytest.approx(4500.0, abs=100.0)


def test_mean_power_at_the_exit_is_three_tenths_of_a_milliwatt(transmitter):
    settings = SimulationSettings()
    mean_mw = transmitter.pulse(290.0, 23.0).energy_pj * 1e-9 * 80e3 * settings.exit_transmission
    assert mean_mw == pytest.approx(0.3, abs=0.02)


def test_the_same_at_20_khz(transmitter):
    assert transmitter.pulse(290.0, 23.0, 20e3).peak_w == pytest.approx(127.9, abs=2.0)


@pytest.mark.parametrize(
    ("prf_hz", "peak_a", "fwhm_ns", "rise_ns", "delay_ns"),
    [(20e3, 19.64, 2.88, 2.41, 0.0), (80e3, 19.72, 2.83, 2.39, 0.2)],
)
def test_current_pulse(transmitter, prf_hz, peak_a, fwhm_ns, rise_ns, delay_ns):
    current = transmitter.current(290.0, 23.0, prf_hz)
    assert current.peak_a == pytest.approx(peak_a, abs=0.02)
    assert current.fwhm_ns == pytest.approx(fwhm_ns, abs=0.05)
    assert current.rise_ns == pytest.approx(rise_ns, abs=0.02)
    assert current.delay_ns == pytest.approx(delay_ns, abs=0.01)


def test_the_charge_of_the_current_is_the_capacitors(transmitter):
    current = transmitter.current(290.0, 23.0, 80e3)
    time_ns = np.linspace(-12.0, 12.0, 20001)
    charge_nc = np.trapezoid([current.at(t) for t in time_ns], time_ns)
    assert charge_nc == pytest.approx(205e-3 * 290.0, rel=1e-3)
    above = time_ns[[current.at(t) > current.peak_a / 2 for t in time_ns]]
    assert np.ptp(above) == pytest.approx(current.fwhm_ns, abs=0.01)


def test_voltage_curves(transmitter):
    volts = np.arange(240.0, 331.0, 1.0)
    pulses = [transmitter.pulse(v, 23.0) for v in volts]
    power = np.array([pulse.peak_w for pulse in pulses])
    width = np.array([pulse.fwhm_ps for pulse in pulses])
    assert power[0] < 10.0
    assert power[-1] == pytest.approx(180.0, abs=9.0)
    assert np.all(np.diff(power) > 0)
    assert np.all(np.diff(width) < 0)
    step = (volts >= 270) & (volts <= 290)
    assert np.ptp(power[step]) > 0.6 * np.ptp(power)
    assert np.ptp(width[step]) > 0.5 * np.ptp(width)
    rise = np.array([pulse.rise_ps for pulse in pulses])[volts >= 250]
    assert rise.min() > 29.0
    assert rise.max() < 85.0


def test_temperature_curves(transmitter):
    degc = np.arange(17.0, 25.01, 0.05)
    pulses = [transmitter.pulse(290.0, t) for t in degc]
    power = np.array([pulse.peak_w for pulse in pulses])
    width = np.array([pulse.fwhm_ps for pulse in pulses])
    best = degc[np.argmax(power)]
    assert best == pytest.approx(23.0, abs=0.5)
    assert np.all(np.diff(power[degc <= best]) > 0)
    assert np.all(np.diff(power[degc >= best]) < 1e-9)
    assert power[-1] > 0.8 * power.max()
    assert np.all(np.diff(width) < 0)
    by_degree = -np.diff([transmitter.pulse(290.0, t).fwhm_ps for t in np.arange(17.0, 25.5)])
    assert np.argmax(by_degree) == 3  # from 20 to 21 degC
    assert width.max() < 125.0


def test_warmer_or_weaker_driven_diodes_emit_later(transmitter):
    delay = transmitter.pulse(290.0, 23.0).delay_ps
    assert transmitter.pulse(290.0, 24.0).delay_ps > delay
    assert transmitter.pulse(280.0, 23.0).delay_ps > delay


def test_misfires_below_the_threshold_of_the_spike(transmitter):
    assert transmitter.pulse(290.0, 23.0).misfire_share == 0.0
    assert 0.2 < transmitter.pulse(234.0, 23.0).misfire_share < 0.8  # the junction is a little colder than at 290 V
    assert transmitter.pulse(225.0, 23.0) == transmitter.misfire(225.0, transmitter.pulse(225.0, 23.0).delay_ps)
    weak = transmitter.misfire(235.0, 4500.0)
    assert weak.fwhm_ps == 637.0
    assert 1.0 < weak.peak_w < 5.0
    assert transmitter.pulse(0.0, 23.0).energy_pj == 0.0


def test_energy_noise_is_that_of_the_current_times_the_slope(transmitter):
    assert transmitter.pulse(280.0, 23.0).energy_noise > 4 * transmitter.pulse(290.0, 23.0).energy_noise
    assert 0.005 < transmitter.pulse(290.0, 23.0).energy_noise < 0.02


def test_overheating_above_300_v_at_80_khz(transmitter):
    moderate, at_limit, hot = (transmitter.block_heat_w(v, 80e3) for v in (290.0, 300.0, 330.0))
    assert moderate < at_limit < 0.5
    assert hot > 3 * at_limit
    assert transmitter.block_heat_w(330.0, 20e3) < at_limit


def test_every_voltage_and_temperature_gives_a_pulse_that_can_be_received(transmitter):
    for drive_v in (0.0, 1.0, 50.0, 72.0, 100.0, 200.0, 228.0, 234.0, 240.0, 330.0, 600.0):
        for degc in (5.0, 17.0, 23.0, 40.0):
            pulse = transmitter.pulse(drive_v, degc)
            assert 30.0 < pulse.fwhm_ps < 1000.0
            assert 0.0 <= pulse.peak_w < 2000.0
            assert 0.0 <= pulse.misfire_share <= 1.0
            assert pulse.energy_noise >= 0.0


def test_a_diode_without_current_noise_has_a_sharp_threshold():
    quiet = Transmitter(SimulationSettings(current_noise=0.0))
    assert quiet.pulse(290.0, 23.0).energy_noise == 0.0
    assert quiet.pulse(290.0, 23.0).misfire_share == 0.0
    assert quiet.pulse(233.0, 23.0).fwhm_ps == 637.0
