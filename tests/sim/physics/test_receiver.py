"""Pulse shape at the photodiode."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.sim.physics import TABLE_PS, Receiver
from picoradar.sim.settings import SimulationSettings


def edges_ps(pulse, levels):
    """Instants at which the leading edge passes ``levels`` of the peak."""
    shape = pulse.shape.astype(np.float64)
    t = pulse.begin_ps + TABLE_PS * np.arange(len(shape))
    peak = int(np.argmax(shape))
    return np.interp(np.array(levels) * shape[peak], shape[: peak + 1], t[: peak + 1])


def one(receiver, charge_fc, fwhm_ps=44.0, arrival_ps=0.0):
    (pulse,) = receiver.pulses(np.array([arrival_ps]), np.array([charge_fc]), fwhm_ps)
    return pulse


def pulse_of(receiver, response_mv):
    charge = response_mv * 10.0
    for _ in range(5):
        charge *= response_mv / one(receiver, charge).response_mv
    return one(receiver, charge)


@pytest.fixture
def receiver() -> Receiver:
    return Receiver(SimulationSettings())


def test_rise_and_width_of_the_response(receiver):
    pulse = pulse_of(receiver, 50.0)
    low, high = edges_ps(pulse, [0.1, 0.9])
    assert high - low == pytest.approx(210.0, abs=5.0)
    above = np.nonzero(pulse.shape > pulse.shape.max() / 2)[0]
    assert (above[-1] - above[0]) * TABLE_PS == pytest.approx(600.0, abs=10.0)
    assert pulse.shape.max() == pytest.approx(pulse.response_mv, rel=0.01)


def test_overshoot_after_the_pulse_is_small(receiver):
    shape = pulse_of(receiver, 50.0).shape
    assert 0.02 < -shape.min() / shape.max() < 0.08
    assert np.argmin(shape) > np.argmax(shape)


def test_edge_comes_later_and_slower_at_small_response(receiver):
    middles, rises = [], []
    for response_mv in (60.0, 25.0, 20.0, 15.0, 10.0):
        low, middle, high = edges_ps(pulse_of(receiver, response_mv), [0.1, 0.5, 0.9])
        middles.append(middle)
        rises.append(high - low)
    assert np.all(np.diff(middles) > 0)
    assert np.all(np.diff(rises) > 0)
    assert middles[1] - middles[0] < 6.7
    assert middles[3] - middles[0] == pytest.approx(40.0, abs=6.7)


def test_charge_is_kept_whatever_the_rise():
    receiver = Receiver(SimulationSettings(saturation_mv=1e4))
    for charge_fc in (100.0, 200.0, 700.0):
        area = one(receiver, charge_fc).shape.sum(dtype=np.float64) * TABLE_PS
        assert area == pytest.approx(charge_fc * 50.0, rel=0.01)


def test_gain_falls_when_the_photodiode_saturates(receiver):
    small, large = (one(receiver, charge).response_mv for charge in (600.0, 6000.0))
    assert large < 8.5 * small
    assert one(receiver, 1200.0).response_mv > 1.9 * small


def test_a_long_weak_laser_pulse_gives_a_slow_response(receiver):
    fast, slow = (one(receiver, 2000.0, fwhm) for fwhm in (44.0, 637.0))
    assert slow.response_mv < 0.8 * fast.response_mv


def test_an_edge_under_the_spot_mixes_close_echoes_and_splits_far_ones(receiver):
    charges = np.array([400.0, 400.0])
    single = one(receiver, 800.0)
    (near,) = receiver.pulses(np.array([0.0, 60.0]), charges, 44.0)
    middle = edges_ps(near, [0.5])[0] - edges_ps(single, [0.5])[0]
    assert 15.0 < middle < 45.0
    assert near.response_mv < single.response_mv
    far = receiver.pulses(np.array([500.0, 0.0]), charges, 44.0)
    assert [round(pulse.begin_ps - single.begin_ps) for pulse in far] == [0, 500]


def test_parts_that_arrive_together_are_one_echo_at_their_middle(receiver):
    (pulse,) = receiver.pulses(np.array([0.0, 4.0]), np.array([300.0, 100.0]), 44.0)
    assert pulse.begin_ps - one(receiver, 400.0).begin_ps == pytest.approx(1.0)


def test_no_light_no_pulse(receiver):
    assert receiver.pulses(np.empty(0), np.empty(0), 44.0) == []
    assert receiver.pulses(np.zeros(2), np.zeros(2), 44.0) == []


def test_shot_noise_has_the_size_of_its_formula(receiver):
    # 2 q F M B R = 2 x 1.6e-19 x 4 x 55 x 1.43e9 x 50 V = 5.0 uV
    assert receiver.shot_noise_mv == pytest.approx(0.0050, rel=0.02)
    bright = Receiver(SimulationSettings(background_nw=1e5))
    assert bright.dark_noise_mv > receiver.dark_noise_mv
