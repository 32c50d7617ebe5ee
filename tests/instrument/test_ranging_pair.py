"""From two time-significant points to a range: each rule of it on numbers that can be worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import SPEED_OF_LIGHT_MM_PER_PS, RangingSettings
from picoradar.instrument.ranging.pair import PulsePair, share_reference, to_ranges

SETTINGS = RangingSettings()
HALF_LIGHT = SPEED_OF_LIGHT_MM_PER_PS / 2


def pair(records: int, **changes: Any) -> PulsePair:
    values = {
        "reference_ps": 100.0, "reference_mv": 45.0, "reference_variance_ps2": 1.0, "echo_variance_ps2": 3.0,
        "interval_ps": 4000.0, "interval_variance_ps2": 4.0, "response_mv": 20.0, "response_variance_mv2": 0.5,
        "covariance_ps_mv": 0.25,
    }  # fmt: skip
    return PulsePair(**{name: np.array(np.broadcast_to(v, records)) for name, v in {**values, **changes}.items()})


def test_the_shared_reference_is_the_weighted_mean_of_those_in_use() -> None:
    variance = [1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0, 1.0]
    own = [100.0, 101.0, 100.0, 101.0, 102.0, 102.0, 102.0, 102.0, 140.0]
    use = np.array([True] * 8 + [False])
    found = share_reference(pair(9, reference_ps=own, reference_variance_ps2=variance), use, SETTINGS)
    assert found.reference_ps[:8] == pytest.approx(100.8)  # (2 + 8 / 4) / 5
    assert found.interval_ps[:8] == pytest.approx(4000.0 + np.array(own[:8]) - 100.8)
    assert found.interval_variance_ps2[:8] == pytest.approx(3.2)
    assert (found.reference_ps[8], found.interval_ps[8], found.interval_variance_ps2[8]) == (140.0, 4000.0, 4.0)


@pytest.mark.parametrize(("squares", "shared"), [(25.6, True), (25.8, False)])
def test_a_reference_that_scatters_more_than_its_noise_is_not_shared(squares: float, *, shared: bool) -> None:
    """Of 8 records with variance 1: 7 + 5 sqrt(14) = 25.708."""
    offset = math.sqrt(squares / 8) * np.array([1.0, -1.0] * 4)
    mine = pair(8, reference_ps=100.0 + offset)
    assert (share_reference(mine, np.ones(8, bool), SETTINGS) is not mine) == shared


def test_seven_references_in_use_are_too_few() -> None:
    mine = pair(9)
    assert share_reference(mine, np.array([True] * 7 + [False] * 2), SETTINGS) is mine


def calibration(**changes: Any) -> Any:
    """Walk 0.5 mm - 0.01 mm/mV (A - 20 mV) with sd 0.02 mm, known from 10 mV; range zero -30 mm."""

    def at(response_mv: np.ndarray) -> Any:
        same = np.ones_like(response_mv)
        return SimpleNamespace(
            error_mm=0.5 - 0.01 * (response_mv - 20.0),
            slope_mm_per_mv=-0.01 * same,
            sd_mm=0.02 * same,
            inside=response_mv >= 10.0,
        )

    parts = {"range_zero_mm": -30.0, "walk": {"template": SimpleNamespace(at=at)}, "reference_ps": (90.0, 110.0)}
    return SimpleNamespace(**{**parts, **changes})


def ranges(mine: PulsePair, known: Any, flags: Any = 0, method: Any = "template") -> Any:
    return to_ranges(mine, np.array(np.broadcast_to(flags, mine.interval_ps.shape), np.uint16), method, known, SETTINGS)


def test_a_range_is_half_the_way_of_light_with_zero_and_walk() -> None:
    found = ranges(pair(2, response_mv=[20.0, 40.0]), calibration())
    assert found.range_mm == pytest.approx(HALF_LIGHT * 4000.0 - 30.0 - np.array([0.5, 0.3]))
    variance = HALF_LIGHT**2 * 4.0 + 0.01**2 * 0.5 + 2 * HALF_LIGHT * 0.01 * 0.25  # of c/2 Ti + 0.01 A
    assert found.variance_mm2 == pytest.approx(variance)
    assert found.bias_sd_mm.tolist() == [0.02, 0.02]
    assert found.flags.tolist() == [0, 0]
    assert found.response_mv.tolist() == [20.0, 40.0]
    assert (found.reference_ps[0], found.reference_mv[0], found.echo_ps[0]) == (100.0, 45.0, 4100.0)


@pytest.mark.parametrize(("known", "zero_mm"), [(None, 0.0), (calibration(walk={}), -30.0)])
def test_without_a_walk_the_range_says_so(known: Any, zero_mm: float) -> None:
    found = ranges(pair(1), known)
    assert found.range_mm[0] == pytest.approx(HALF_LIGHT * 4000.0 + zero_mm)
    assert found.variance_mm2[0] == pytest.approx(HALF_LIGHT**2 * 4.0)
    assert (found.bias_sd_mm[0], found.flags[0]) == (0.0, Flag.WALK_EXTRAPOLATED)


def test_weak_echoes_and_those_beyond_the_walk_are_flagged() -> None:
    found = ranges(pair(4, response_mv=[15.0, 14.9, 9.9, 10.0]), calibration())
    low, beyond = Flag.LOW_RESPONSE, Flag.WALK_EXTRAPOLATED
    assert found.flags.tolist() == [0, low, low | beyond, low]


def test_without_an_echo_only_the_reference_is_left() -> None:
    found = ranges(pair(1, response_mv=5.0), calibration(), Flag.NO_ECHO)
    assert found.flags[0] == Flag.NO_ECHO
    for values in (found.range_mm, found.variance_mm2, found.response_mv, found.bias_sd_mm, found.echo_ps):
        assert np.isnan(values).all()
    assert (found.reference_ps[0], found.reference_mv[0]) == (100.0, 45.0)


def test_a_reference_that_is_not_in_its_place_is_none() -> None:
    places = [89.9, 90.0, 110.0, 110.1, math.nan]
    found = ranges(pair(5, reference_ps=places), calibration())
    gone = [True, False, False, True, True]
    assert [flag == Flag.NO_REFERENCE for flag in found.flags] == gone
    for values in (found.reference_ps, found.reference_mv, found.range_mm, found.echo_ps):
        assert np.isnan(values).tolist() == gone
    anywhere = ranges(replace(pair(5), reference_ps=np.array([*places[:4], 1e4])), calibration(reference_ps=None))
    assert not anywhere.flags.any()
