"""Pulse shape at the photodiode."""

from __future__ import annotations

import numpy as np
import pytest

from sim.receiver import TABLE_PS, Receiver
from sim.settings import SimulationSettings


def edges_ps(shape, levels, start_ps):
    """Instants at which the leading edge passes ``levels`` of the peak."""
    t = start_ps + TABLE_PS * np.arange(len(shape))
    peak = int(np.argmax(shape))
    return np.interp(np.array(levels) * shape[peak], shape[: peak + 1], t[: peak + 1])


@pytest.fixture
def receiver() -> Receiver:
    return Receiver(SimulationSettings())


def charge_of(receiver, response_mv):
    charge = response_mv * 10.0
    for _ in range(4):
        charge *= response_mv / receiver.echo(charge, 44.0).response_mv
    return charge


def test_rise_and_width_of_the_response(receiver):
    pulse = receiver.echo(charge_of(receiver, 50.0), 44.0)
    shape = pulse.shape.astype(np.float64)
    low, high = edges_ps(shape, [0.1, 0.9], pulse.start_ps)
    assert high - low == pytest.approx(210.0, abs=5.0)
    above = np.nonzero(shape > shape.max() / 2)[0]
    assert (above[-1] - above[0]) * TABLE_PS == pytest.approx(600.0, abs=10.0)
    assert pulse.response_mv == pytest.approx(50.0, abs=0.1)
    assert shape.max() == pytest.approx(50.0, rel=0.01)


def test_overshoot_after_the_pulse_is_small(receiver):
    shape = receiver.echo(charge_of(receiver, 50.0), 44.0).shape
    assert 0.02 < -shape.min() / shape.max() < 0.08
    assert np.argmin(shape) > np.argmax(shape)


def test_edge_comes_later_and_slower_at_small_response(receiver):
    middles, rises = [], []
    for response_mv in (60.0, 25.0, 20.0, 15.0, 10.0):
        pulse = receiver.echo(charge_of(receiver, response_mv), 44.0)
        low, middle, high = edges_ps(pulse.shape.astype(np.float64), [0.1, 0.5, 0.9], pulse.start_ps)
        middles.append(middle)
        rises.append(high - low)
    assert np.all(np.diff(middles) > 0)
    assert np.all(np.diff(rises) > 0)
    assert middles[1] - middles[0] < 6.7
    assert middles[3] - middles[0] == pytest.approx(40.0, abs=6.7)


def test_charge_is_kept_whatever_the_rise(receiver):
    for response_mv in (10.0, 15.0, 60.0):
        charge = charge_of(receiver, response_mv)
        area = receiver.echo(charge, 44.0).shape.sum(dtype=np.float64) * TABLE_PS
        assert area == pytest.approx(charge * 50.0, rel=0.01)


def test_a_long_weak_laser_pulse_gives_a_slow_response(receiver):
    fast, slow = (receiver.echo(2000.0, fwhm) for fwhm in (44.0, 637.0))
    assert slow.response_mv < 0.8 * fast.response_mv
