"""Diode block: exact in time, and a plant that a PI loop warms up in a minute or two."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.sim.physics import DiodeBlock
from picoradar.sim.settings import SimulationSettings

SETTINGS = SimulationSettings()


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


def test_starts_at_the_air_and_stays_there(clock):
    block = DiodeBlock(clock, SETTINGS)
    clock.sleep(1000.0)
    assert block.temperature_degc() == pytest.approx(SETTINGS.ambient_degc, abs=1e-9)
    assert block.sink_degc() == pytest.approx(SETTINGS.ambient_degc, abs=1e-9)


def test_result_does_not_depend_on_how_often_it_is_looked_at():
    seen = []
    for looks in (1, 7, 500):
        clock = VirtualClock()
        block = DiodeBlock(clock, SETTINGS)
        block.drive(0.8)
        for _ in range(looks):
            clock.sleep(100.0 / looks)
            block.temperature_degc()
        seen.append((block.temperature_degc(), block.sink_degc()))
    np.testing.assert_allclose(seen, np.broadcast_to(seen[0], (3, 2)), atol=1e-9)


def test_heating_warms_the_block_and_cooling_warms_the_sink(clock):
    block = DiodeBlock(clock, SETTINGS)
    block.drive(0.5)
    clock.sleep(60.0)
    assert block.temperature_degc() > SETTINGS.ambient_degc + 1
    block.drive(-0.5)
    clock.sleep(600.0)
    assert block.temperature_degc() < SETTINGS.ambient_degc
    assert block.sink_degc() > SETTINGS.ambient_degc


def test_energy_balance_at_rest(clock):
    block = DiodeBlock(clock, SETTINGS)
    block.heated_by(lambda: 0.4)
    clock.sleep(1e5)
    through_w = SETTINGS.block_conductance_w_per_k * (block.temperature_degc() - block.sink_degc())
    to_air_w = SETTINGS.sink_conductance_w_per_k * (block.sink_degc() - SETTINGS.ambient_degc)
    assert through_w == pytest.approx(0.4, abs=1e-6)
    assert to_air_w == pytest.approx(0.4, abs=1e-6)


def test_warms_up_to_23_degc_within_minutes_under_a_pi_loop(clock):
    block = DiodeBlock(clock, SETTINGS)
    integral, settled_s = 0.0, None
    for tick in range(3000):
        error = 23.0 - block.temperature_degc()
        proposed = 1.0 * error + integral
        current = min(max(proposed, -1.5), 1.5)
        if current == proposed:
            integral += 1.0 * error * 0.1 / 20.0
        block.drive(current)
        clock.sleep(0.1)
        if abs(23.0 - block.temperature_degc()) > 0.01:
            settled_s = None
        elif settled_s is None:
            settled_s = tick * 0.1
    assert settled_s is not None
    assert 10.0 < settled_s < 240.0
