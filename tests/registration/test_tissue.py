"""Bone or tissue: the likelihoods of docs/registration.md (3), (4) and (11), written down a second time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import norm

from picoradar.registration.scan import bone_probability, log_likelihood, neighbour_sum, observed_share
from picoradar.registration.scan.tissue import log_odds, neighbour_odds
from picoradar.registration.settings import TissueSettings

TISSUE = TissueSettings()
RESIDUALS = np.array([-1.0, -0.2, 0.0, 0.35, 0.8, 2.5])
SIGMA = np.array([0.2, 0.25, 0.3, 0.3, 0.4, 0.2])
ALONE = np.full((6, 8), 6)
BESIDE = ALONE.copy()
BESIDE[0, :2], BESIDE[1, 3], BESIDE[5, 7] = (1, 2), 0, 4


def densities(residuals: np.ndarray, sigma: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    onset = expit((residuals - TISSUE.onset_mm) / TISSUE.onset_width_mm)
    return norm.pdf(residuals, scale=sigma), TISSUE.density_per_mm * onset + TISSUE.stray_per_mm


@pytest.mark.parametrize("sigma", [SIGMA, 0.3])
def test_the_log_odds_are_those_of_the_two_densities(sigma: np.ndarray | float) -> None:
    bone, tissue = densities(RESIDUALS, sigma)
    np.testing.assert_allclose(log_odds(RESIDUALS, sigma, TISSUE), np.log(bone / tissue), rtol=1e-12)


def test_far_from_the_surface_the_odds_stay_finite() -> None:
    far = log_odds(np.array([-1e3, 1e3]), 0.3, TISSUE)
    z = 0.5 * (1e3 / 0.3) ** 2
    level = np.log([TISSUE.stray_per_mm, TISSUE.stray_per_mm + TISSUE.density_per_mm])
    np.testing.assert_allclose(far, norm.logpdf(0.0, scale=0.3) - z - level, rtol=1e-12)
    steep = replace(TISSUE, onset_width_mm=1e-3, stray_per_mm=1e-30)
    lowest = log_odds(np.array([-2.0]), 0.3, steep)  # the exponent ends at 50
    expected = norm.logpdf(-2.0, scale=0.3) - np.log(TISSUE.density_per_mm * expit(-50.0))
    np.testing.assert_allclose(lowest, expected, rtol=1e-6)
    with np.errstate(over="raise"):
        single = log_odds(np.array([-1e3, 1e3], dtype=np.float32), 0.3, TISSUE)
    assert single.dtype == np.float32


def test_neighbours_are_summed_and_none_counts_nothing() -> None:
    values = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    assert neighbour_sum(values, BESIDE).tolist() == [6.0, 1.0, 0.0, 0.0, 0.0, 16.0]
    many = neighbour_sum(np.stack([values, 2 * values]), BESIDE)
    assert many.tolist() == [[6.0, 1.0, 0.0, 0.0, 0.0, 16.0], [12.0, 2.0, 0.0, 0.0, 0.0, 32.0]]
    assert neighbour_sum(values.astype(np.float32), BESIDE).dtype == np.float32


def test_neighbours_lend_a_share_of_their_odds_up_to_a_limit() -> None:
    limit = TISSUE.max_neighbour_nats
    own = np.array([2 * limit, 0.5 * limit, -3 * limit, 0.0, -0.25 * limit, 0.0])
    lent = neighbour_odds(own, BESIDE, TISSUE)
    expected = TISSUE.coupling * limit * np.array([0.5 - 1.0, 1.0, 0.0, 0.0, 0.0, -0.25])
    np.testing.assert_allclose(lent, expected, rtol=1e-12, atol=1e-15)


def test_the_probability_of_bone_is_that_of_own_and_lent_odds() -> None:
    own = log_odds(RESIDUALS, SIGMA, TISSUE)
    np.testing.assert_allclose(
        bone_probability(RESIDUALS, SIGMA, ALONE, TISSUE), expit(np.maximum(own, -50.0)), rtol=1e-12
    )
    lent = neighbour_odds(own, BESIDE, TISSUE)
    assert abs(lent).max() > 0.1
    both = expit(np.maximum(own + lent, -50.0))
    np.testing.assert_allclose(bone_probability(RESIDUALS, SIGMA, BESIDE, TISSUE), both, rtol=1e-12)
    sure = bone_probability(np.array([-1e3]), 0.3, np.array([[1] * 8]), TISSUE)
    np.testing.assert_allclose(sure, expit(-50.0), rtol=1e-9)


@pytest.mark.parametrize("sigma", [SIGMA, 0.3])
def test_the_likelihood_is_that_of_the_mixture(sigma: np.ndarray | float) -> None:
    bone, tissue = densities(RESIDUALS, sigma)
    share = expit(neighbour_odds(np.log(bone / tissue), BESIDE, TISSUE))
    expected = np.log(share * bone + (1 - share) * tissue)
    np.testing.assert_allclose(log_likelihood(RESIDUALS, sigma, BESIDE, TISSUE), expected, rtol=1e-9)


def test_single_precision_stays_single() -> None:
    residuals = RESIDUALS.astype(np.float32)
    for sigma in (0.3, SIGMA.astype(np.float32)):
        assert log_likelihood(residuals, sigma, BESIDE, TISSUE).dtype == np.float32


@pytest.mark.parametrize("shift", [-0.6, 0.0, 0.5, 0.9, 1.4])
def test_the_observed_share_is_how_the_pull_of_a_point_answers(shift: float) -> None:
    """The derivative of P r with the neighbours' say held; of bone beyond doubt it is one, of tissue nothing."""
    settings = TissueSettings()
    around = np.full((3, 8), 3)
    around[0, :2], around[1, 0], around[2, 0] = [1, 2], 0, 0
    residual = np.array([shift, 0.1, 2.0])
    odds = log_odds(residual, 0.4, settings)
    lent = neighbour_odds(odds, around, settings)

    def pull(r: np.ndarray) -> np.ndarray:
        return np.asarray(r / (1.0 + np.exp(-(log_odds(r, 0.4, settings) + lent))))

    expected = (pull(residual + 1e-6) - pull(residual - 1e-6)) / 2e-6
    np.testing.assert_allclose(observed_share(residual, 0.4, around, settings), expected, rtol=1e-5, atol=1e-7)


def test_doubt_takes_information_away() -> None:
    alone = np.full((3, 8), 3)
    sure, doubtful, tissue = observed_share(np.array([-0.3, 0.85, 5.0]), 0.4, alone, TissueSettings())
    assert sure > 0.9
    assert doubtful < 0.0
    assert tissue == pytest.approx(0.0, abs=1e-6)
