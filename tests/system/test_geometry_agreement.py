"""The instrument's closed form and the simulator's reflected rays, which share no formula, meet at the same points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.clock import VirtualClock
from picoradar.instrument.calibration import CENTRE_CODE, codes_to_angles, points_from
from picoradar.instrument.calibration.geometry import CODES
from picoradar.sim.physics import MirrorPair, Noise
from picoradar.sim.settings import SimulationSettings


def mirrors(separation_mm: float, field_deg: float) -> tuple[MirrorPair, VirtualClock]:
    clock = VirtualClock()
    perfect = SimulationSettings(mirror_separation_mm=separation_mm, field_deg=field_deg, repeatability_deg=0.0)
    return MirrorPair(clock, perfect, Noise(0)), clock


@settings(max_examples=60, deadline=None)
@given(
    x_code=st.integers(0, CODES - 1),
    y_code=st.integers(0, CODES - 1),
    range_mm=st.floats(600, 1500),
    separation_mm=st.floats(0, 60),
    field_deg=st.floats(1, 40),
)
def test_a_point_along_the_reflected_ray_is_the_point_of_the_closed_form(
    x_code: int, y_code: int, range_mm: float, separation_mm: float, field_deg: float
) -> None:
    pair, clock = mirrors(separation_mm, field_deg)
    pair.command((x_code - CENTRE_CODE) / CENTRE_CODE, (y_code - CENTRE_CODE) / CENTRE_CODE)
    clock.sleep(10.0)  # servo and creep have long settled
    beam = pair.beam(clock.now(), 1, 0, 0)
    on_ray = beam.origin + (range_mm + separation_mm - beam.path_mm) * beam.direction
    angles = codes_to_angles([[x_code, y_code]], field_deg)
    np.testing.assert_allclose(points_from(angles, [range_mm], separation_mm)[0], on_ray, rtol=0, atol=1e-9)


def test_the_ray_leaves_straight_ahead_at_the_centre_code() -> None:
    pair, clock = mirrors(30.0, 10.0)
    pair.command(0.0, 0.0)
    clock.sleep(1.0)
    beam = pair.beam(clock.now(), 1, 0, 0)
    np.testing.assert_allclose(beam.origin, [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(beam.direction, [0, 0, 1], atol=1e-12)
    assert beam.path_mm == pytest.approx(30.0, abs=1e-12)
