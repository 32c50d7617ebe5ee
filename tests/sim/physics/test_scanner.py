"""Two mirrors: the reflected ray, and the way from one place to the next."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.clock import VirtualClock
from picoradar.sim.physics import MirrorPair, Noise, trace
from picoradar.sim.settings import SimulationSettings

QUIET = SimulationSettings(repeatability_deg=0.0)
angles = st.floats(-0.3, 0.3)


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


def test_mirrors_at_rest_send_the_beam_out_along_z():
    beam = trace(0.0, 0.0, 30.0)
    np.testing.assert_allclose(beam.origin, [0, 0, 0], atol=1e-14)
    np.testing.assert_allclose(beam.direction, [0, 0, 1], atol=1e-14)
    assert beam.path_mm == pytest.approx(30.0)


def test_a_mechanical_turn_deflects_by_twice_as_much_towards_positive():
    assert trace(0.05, 0.0, 30.0).direction @ [1, 0, 0] == pytest.approx(math.sin(0.1))
    assert trace(0.0, 0.05, 30.0).direction @ [0, 1, 0] == pytest.approx(math.sin(0.1))


@settings(deadline=None, max_examples=60)
@given(angles, angles, st.floats(0.0, 100.0))
def test_reflection_keeps_length_and_the_beam_starts_on_both_mirrors(x_rad, y_rad, separation_mm):
    beam = trace(x_rad / 2, y_rad / 2, separation_mm)
    assert np.linalg.norm(beam.direction) == pytest.approx(1.0, abs=1e-12)
    assert abs(np.linalg.norm(beam.origin - [0.0, -separation_mm, 0.0]) - beam.path_mm) < 1e-9
    assert beam.direction[0] == pytest.approx(math.sin(x_rad), abs=1e-12)
    assert math.atan2(beam.direction[1], beam.direction[2]) == pytest.approx(y_rad, abs=1e-12)


def test_a_non_orthogonal_axis_tilts_the_lines():
    straight, tilted = trace(0.0, 0.05, 30.0), trace(0.0, 0.05, 30.0, math.radians(0.5))
    assert straight.direction[0] == pytest.approx(0.0, abs=1e-14)
    assert abs(tilted.direction[0]) > 1e-4


def test_flyback_misses_half_a_millimetre_before_the_creep_is_over(clock):
    mirrors = MirrorPair(clock, QUIET, Noise(1))
    at_1_m = 1000.0 * math.radians(QUIET.field_deg / 2)
    mirrors.command(-20 / at_1_m, 0.0)
    clock.sleep(1.0)
    mirrors.command(20 / at_1_m, 0.0)
    missing_mm = [20.0 - mirrors.position(1.0 + t)[0] * at_1_m for t in (0.0, 0.002, 0.05)]
    assert missing_mm[0] == pytest.approx(40.0)
    assert 0.3 < missing_mm[1] < 0.5
    assert missing_mm[2] < 1e-3


def test_a_step_of_one_millimetre_lands_within_a_tenth(clock):
    settings = SimulationSettings()
    mirrors = MirrorPair(clock, settings, Noise(5))
    mirrors.command(-0.02 / math.radians(settings.field_deg / 2), 0.0)
    clock.sleep(1.0)
    errors_mm = []
    for number in range(1, 40):
        x_rad = (number - 20) * 1e-3
        mirrors.command(x_rad / math.radians(settings.field_deg / 2), 0.0)
        clock.sleep(0.002)
        errors_mm.append((mirrors.angles_rad(clock.now(), number) - [x_rad, 0.0]) * 1000.0)
    assert 0.02 < np.std(errors_mm) < 0.05
    assert np.abs(errors_mm).max() < 0.15


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(1e-5, 5e-3)), min_size=2, max_size=8))
def test_position_is_continuous_and_does_not_depend_on_who_looked(moves):
    looked, unseen = VirtualClock(), VirtualClock()
    watched, alone = MirrorPair(looked, QUIET, Noise(1)), MirrorPair(unseen, QUIET, Noise(1))
    for x, wait_s in moves:
        before = watched.position(looked.now())
        watched.command(x, -x)
        alone.command(x, -x)
        np.testing.assert_allclose(watched.position(looked.now()), before, atol=1e-12)
        looked.sleep(wait_s / 2)
        watched.position(looked.now())
        looked.sleep(wait_s / 2)
        unseen.sleep(wait_s)
    np.testing.assert_allclose(watched.position(looked.now()), alone.position(unseen.now()), atol=1e-9)


def test_the_past_can_still_be_asked_for(clock):
    mirrors = MirrorPair(clock, QUIET, Noise(1))
    mirrors.command(0.5, 0.0)
    clock.sleep(1.0)
    mirrors.command(-0.5, 0.0)
    clock.sleep(1.0)
    assert mirrors.position(0.9)[0] == pytest.approx(0.5)
    assert mirrors.position(2.0)[0] == pytest.approx(-0.5)


def test_static_errors_of_scale_and_offset(clock):
    mirrors = MirrorPair(
        clock, SimulationSettings(repeatability_deg=0.0, x_scale_error=0.01, y_offset_deg=0.1), Noise(1)
    )
    mirrors.command(0.4, 0.0)
    clock.sleep(1.0)
    np.testing.assert_allclose(np.degrees(mirrors.angles_rad(1.0, 1)), [0.4 * 5 * 1.01, 0.1], atol=1e-9)


def test_a_command_outside_the_span_is_refused(clock):
    with pytest.raises(ValueError, match="outside"):
        MirrorPair(clock, QUIET, Noise(1)).command(1.01, 0.0)


@pytest.mark.parametrize(("percent", "limit_deg"), [(0.3, 0.12), (0.005, 0.002)])
def test_static_error_of_a_scanner_class_is_smooth_and_within_its_limit(clock, percent, limit_deg):
    scanner = SimulationSettings(repeatability_deg=0.0, linearity_percent=percent, field_deg=40.0)
    worst = 0.0
    for seed in range(20):
        mirrors = MirrorPair(clock, scanner, Noise(seed))
        errors = []
        for place in np.linspace(-1, 1, 41):
            mirrors.command(place, -place)
            clock.sleep(1.0)
            errors.append(np.degrees(mirrors.angles_rad(clock.now(), 1)) - 20.0 * place * np.array([1.0, -1.0]))
        assert np.abs(np.diff(errors, axis=0)).max() < 0.35 * limit_deg
        worst = max(worst, np.abs(errors).max())
    assert 0.3 * limit_deg < worst <= 1.001 * limit_deg
