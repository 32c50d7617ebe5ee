"""Laser pulse at the dissertation's operating points."""

from __future__ import annotations

import pytest

from sim.settings import SimulationSettings
from sim.transmitter import Transmitter


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


def test_weak_long_pulse_at_low_injection(transmitter):
    pulse = transmitter.pulse(240.0, 23.0)
    assert pulse.fwhm_ps == pytest.approx(637.0, abs=10.0)
    assert pulse.peak_w < 5.0
    assert transmitter.pulse(0.0, 23.0).energy_pj == 0.0
