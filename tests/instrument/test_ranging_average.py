"""Averages that leave out failed sweeps and wild readings."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging import average_ranges, average_sweeps


@pytest.fixture
def sweeps() -> np.ndarray:
    rng = np.random.default_rng(1)
    pulse = 45.0 * np.exp(-(((np.arange(192) - 90) / 30.0) ** 2))
    return pulse + rng.normal(0, 0.6, (200, 8, 192))


def test_good_sweeps_all_count(sweeps: np.ndarray) -> None:
    found = average_sweeps(sweeps)
    assert (found.sweeps == 8).mean() > 0.995
    whole = found.sweeps == 8
    np.testing.assert_allclose(found.traces_mv[whole], sweeps.mean(axis=1)[whole])


@pytest.mark.parametrize("failure", ["no laser", "misfire", "trigger late"])
def test_a_failed_sweep_is_left_out(sweeps: np.ndarray, failure: str) -> None:
    bad = sweeps.copy()
    if failure == "no laser":
        bad[:, 3] -= np.mean(sweeps, axis=(0, 1))
    elif failure == "misfire":
        bad[:, 3, 85] = 0.0
    else:
        bad[:, 3] = np.roll(bad[:, 3], 4, axis=1)
    found = average_sweeps(bad)
    assert found.left_out[:, 3].all()
    assert found.left_out[:, [0, 1, 2, 4, 5, 6, 7]].mean() < 0.01
    np.testing.assert_allclose(found.traces_mv[0], np.delete(bad[0], 3, axis=0).mean(axis=0))


def test_of_two_sweeps_none_is_judged(sweeps: np.ndarray) -> None:
    bad = sweeps[:, :2].copy()
    bad[:, 0] = 0.0
    assert not average_sweeps(bad).left_out.any()
    assert average_sweeps(sweeps[:, :1]).traces_mv.shape == (200, 192)


def test_ranges_are_weighted_by_their_variances() -> None:
    found = average_ranges([[900.0, 901.0]], [[0.01, 0.04]])
    assert found.range_mm[0] == pytest.approx(900.2)
    assert found.variance_mm2[0] == pytest.approx(1 / 125)


def test_repeated_ranges_have_the_variance_told() -> None:
    rng = np.random.default_rng(2)
    variance = rng.uniform(0.01, 0.2, (4000, 6))
    found = average_ranges(900.0 + rng.normal(0, np.sqrt(variance)), variance)
    assert np.mean((found.range_mm - 900.0) ** 2 / found.variance_mm2) == pytest.approx(1.0, abs=0.07)
    assert found.left_out.mean() < 1e-3


def test_wild_and_missing_readings_are_left_out() -> None:
    ranges = np.array([[900.0, 900.1, 950.0, 899.9], [np.nan, 870.0, np.nan, np.nan], [np.nan] * 4])
    found = average_ranges(ranges, np.where(np.isnan(ranges), np.nan, 0.04))
    np.testing.assert_array_equal(found.readings, [3, 1, 0])
    np.testing.assert_allclose(found.range_mm, [900.0, 870.0, np.nan])
    assert found.left_out[0].tolist() == [False, False, True, False]


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(BadInput, match="records, sweeps, samples"):
        average_sweeps(np.zeros((3, 4)))
    with pytest.raises(BadInput, match="points, readings"):
        average_ranges(np.zeros((3, 4)), np.ones((3, 5)))
    with pytest.raises(BadInput, match="positive"):
        average_ranges(np.zeros((3, 4)), np.zeros((3, 4)))
