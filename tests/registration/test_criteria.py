"""The robust criteria's constants, against the formulas sheet (section 2.6)."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.registration.classic import LOSSES
from picoradar.registration.classic.losses import LeastMedian, OneSided, SelfTrimmed, mad_scale


def weight_at(name: str, scaled: float) -> float:
    """Weight of a residual of `scaled` standard deviations among many Gaussian ones."""
    residuals = np.append(np.random.default_rng(0).normal(0.0, 2.0, 200_000), 0.0)
    residuals[-1] = scaled * mad_scale(residuals)
    return float(LOSSES[name].weights(residuals)[-1])


@pytest.mark.parametrize(
    ("name", "scaled", "weight"),
    [
        ("Huber", 1.345, 1.0),
        ("Huber", 2.69, 0.5),
        ("Tukey", 4.685, 0.0),
        ("Tukey", 4.685 / 2.0, 0.5625),
        ("Cauchy", 2.385, 0.5),
        ("Welsch", 2.985, np.exp(-1.0)),
        ("Geman-McClure", 1.0, 0.25),
    ],
)
def test_weights_at_the_constants(name: str, scaled: float, weight: float) -> None:
    assert weight_at(name, scaled) == pytest.approx(weight, abs=1e-3)


def test_the_scale_is_that_of_a_gaussian() -> None:
    assert mad_scale(np.random.default_rng(1).normal(0.0, 0.4, 100_000)) == pytest.approx(0.4, rel=0.01)


def test_least_median_has_the_small_sample_factor() -> None:
    """1.4826 (1 + 5 / (n - p)) times the root of the median square, p = 6."""
    residuals = np.concatenate(
        [np.full(10, 1.0), np.array([2.5 * 1.4826 * (1.0 + 5.0 / 6.0) + d for d in (-1e-6, 1e-6)])]
    )
    np.testing.assert_array_equal(LeastMedian().weights(residuals)[-2:], [1.0, 0.0])


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_self_trimming_leaves_out_all_outliers_and_the_tails_of_the_rest(share: float) -> None:
    """The objective is least where the limit squared is 4 times the mean square below it: 1.45 deviations, 85 %."""
    rng = np.random.default_rng(2)
    count = round(1000 * share)
    residuals = np.concatenate([rng.normal(0.0, 0.3, 1000 - count), rng.uniform(3.0, 9.0, count)])
    weights = SelfTrimmed().weights(residuals)
    assert weights[-count:].sum() == 0.0
    limit = np.abs(residuals[weights > 0.0]).max()
    mean_square = np.mean(residuals[weights > 0.0] ** 2)
    assert limit**2 / mean_square == pytest.approx(4.0, rel=0.1)
    assert weights[:-count].mean() == pytest.approx(0.853, abs=0.04)


def test_the_one_sided_weight_forgives_in_front_only() -> None:
    residuals = np.concatenate([np.random.default_rng(3).normal(0.0, 0.3, 1000), [1.2, -1.2]])
    in_front, behind = OneSided().weights(residuals)[-2:]
    assert in_front < 0.02
    assert behind > 0.5
