"""What lines and patches share, against Monte Carlo; noise alone shares nothing."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.registration.settings import TrustSettings
from picoradar.registration.trust.correlation import cells, excess_noise, shared_spread, shared_variance

ROWS, COLUMNS = 40, 50


def raster() -> tuple[np.ndarray, np.ndarray]:
    """Lines (N,) and places (N, 3), a millimetre apart."""
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    return row, np.stack([column, row, np.zeros_like(row)], axis=1).astype(float)


def test_noise_shares_nothing_with_line_or_patch_but_by_chance() -> None:
    line, places = raster()
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(300, len(line)))
    patch = cells(places, 8.0)
    for group, beside in ((line, True), (patch, False)):
        found = [shared_variance(one, group, 3.0, beside=beside) for one in noise]
        assert np.mean(np.array(found) > 0.0) < 0.04
        every = [shared_variance(one, group, -1e9, beside=beside) for one in noise]
        assert abs(np.mean(every)) < 3.0 * np.std(every) / np.sqrt(300)
        assert np.mean(np.array([shared_variance(o, group, 1.0, beside=beside) for o in noise]) > 0) > 0.08


def test_the_error_of_lines_and_of_patches_is_measured() -> None:
    line, places = raster()
    patch = cells(places, 8.0)
    rng = np.random.default_rng(2)
    by_line, by_patch = [], []
    for _ in range(100):
        noise = rng.normal(size=len(line))
        by_line.append(shared_variance(noise + 0.5 * rng.normal(size=ROWS)[line], line, 3.0, beside=True))
        of_patch = np.unique(patch, return_inverse=True)[1]
        by_patch.append(shared_variance(noise + 0.5 * rng.normal(size=of_patch.max() + 1)[of_patch], patch, 3.0))
    assert np.mean(by_line) == pytest.approx(0.25, rel=0.1)
    assert np.mean(by_patch) == pytest.approx(0.25, rel=0.15)


def test_what_patches_share_is_no_error_of_lines() -> None:
    line, places = raster()
    wave = np.sin(places[:, 1] / 6.0)
    noise = np.random.default_rng(3).normal(size=len(line))
    assert shared_variance(noise + wave, line, 3.0) > 0.3
    assert shared_variance(noise + wave, line, 3.0, beside=True) < 0.1


def test_the_pull_of_a_group_spreads_as_drawn() -> None:
    line, places = raster()
    pulls = np.stack([places[:, 0], np.ones(len(line)), places[:, 1]], axis=1)
    rng = np.random.default_rng(4)
    drawn = np.array([pulls.T @ rng.normal(size=ROWS)[line] for _ in range(4000)])
    np.testing.assert_allclose(np.cov(drawn.T), shared_spread(pulls, line), rtol=0.1, atol=1e5)


def test_a_cell_holds_the_area_over_which_an_error_is_the_same() -> None:
    places = np.random.default_rng(5).uniform(0.0, 100.0, (20_000, 3)) * [1.0, 1.0, 0.0]
    number = len(np.unique(cells(places, 5.0)))
    assert number == pytest.approx(100.0**2 / (np.pi * 5.0**2), rel=0.2)


def test_noise_that_grows_where_beams_graze_is_measured_there() -> None:
    rng = np.random.default_rng(6)
    cosine, used = rng.uniform(0.2, 1.0, 4000), np.ones(4000, dtype=bool)
    noise = rng.normal(size=4000)
    assert (excess_noise(noise, cosine, used, TrustSettings()) == 1.0).all()
    grown = excess_noise(np.where(cosine < 0.4, 2.0, 1.0) * noise, cosine, used, TrustSettings())
    assert grown[cosine < 0.39].min() > 3.0
    assert (grown[cosine > 0.5] == 1.0).all()
    tissue = np.where(rng.random(4000) < 0.3, 9.0, noise)
    assert (excess_noise(tissue, cosine, tissue != 9.0, TrustSettings()) == 1.0).all()
