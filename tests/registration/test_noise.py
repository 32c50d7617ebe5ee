"""The noise of a range, from what there is to tell it: ranges of the points, a raster, residuals, or nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from picoradar.registration.scan import Scan, checked_scan, estimated_range_noise, initial_noise
from picoradar.registration.scan.noise import SIGMA_PER_MAD
from picoradar.registration.scan.response import relative_noise
from picoradar.registration.settings import NoiseSettings

SETTINGS = NoiseSettings()
FAR = np.array([0.0, 0.0, 1e5])


def rastered(noise_mm: float, columns: int = 20, rows: int = 20) -> Scan:
    """A flat raster seen from far above, with noise of the ranges."""
    x, y = np.meshgrid(1.5 * np.arange(columns), 1.5 * np.arange(rows))
    z = np.random.default_rng(4).normal(0.0, 1.0, x.size) * noise_mm
    return checked_scan(np.stack([x.ravel(), y.ravel(), z], axis=1), origin=FAR)


@pytest.mark.parametrize(("sd_mm", "expected_mm"), [(0.0, 0.02), (0.3, 0.3), (4.9, 4.9), (70.0, 5.0)])
def test_ranges_that_know_their_noise_are_believed_within_what_an_instrument_has(
    sd_mm: float, expected_mm: float
) -> None:
    """Points made by a formula have none, and units may be mistaken."""
    scan = rastered(0.0)
    given = replace(scan, range_sd_mm=np.full(len(scan), sd_mm))
    assert initial_noise(given, None, SETTINGS) == pytest.approx(expected_mm)
    covariance = np.tile(sd_mm**2 * np.eye(3), (len(scan), 1, 1))
    assert initial_noise(replace(scan, covariance=covariance), None, SETTINGS) == pytest.approx(expected_mm)
    assert initial_noise(given, 0.001, SETTINGS) == 0.001, "what a user gives stands"


@pytest.mark.parametrize(("noise_mm", "expected_mm"), [(0.01, 0.1), (0.4, 0.26), (20.0, 2.0)])
def test_a_raster_tells_its_share_within_what_a_search_can_use(noise_mm: float, expected_mm: float) -> None:
    """Smooth bodies without noise, and ranges that are mostly stray, have another raster than they have noise."""
    assert initial_noise(rastered(noise_mm), None, SETTINGS) == pytest.approx(expected_mm, rel=0.1)


@pytest.mark.parametrize(("columns", "rows", "told"), [(7, 6, True), (21, 3, False), (6, 6, False)])
def test_a_raster_of_few_inner_points_tells_nothing(columns: int, rows: int, *, told: bool) -> None:
    """Of 7 x 6 points 20 have all neighbours about them, of 6 x 6 sixteen, of three rows nineteen."""
    found = initial_noise(rastered(0.0, columns, rows), None, SETTINGS)
    assert found == (SETTINGS.raster_min_mm if told else SETTINGS.typical_range_mm)


@pytest.mark.parametrize(("count", "told"), [(20, True), (19, False)])
def test_few_residuals_tell_no_scale(count: int, *, told: bool) -> None:
    found = estimated_range_noise(np.tile([-0.3, 0.3], 10)[:count], 0.7, SETTINGS)
    assert found == pytest.approx(0.3 * SIGMA_PER_MAD if told else 0.7)


@pytest.mark.parametrize(("residual_mm", "expected_mm"), [(0.0, 0.02), (1.0, SIGMA_PER_MAD), (100.0, 5.0)])
def test_residuals_are_believed_within_what_an_instrument_has(residual_mm: float, expected_mm: float) -> None:
    assert estimated_range_noise(np.full(50, residual_mm), 0.7, SETTINGS) == pytest.approx(expected_mm)


def test_the_noise_of_an_echo_differs_from_the_median_by_a_factor_of_four_at_most() -> None:
    relative = relative_noise(np.array([1e-3, 30.0, 30.0, 30.0, 1e6]), SETTINGS.max_response_ratio)
    np.testing.assert_allclose(relative[[0, 2, 4]], [4.0, 1.0, 0.25])
