"""The walk fit: smooth, falling, with an uncertainty that covers what it does not know."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging import fit_walk

Level = tuple[np.ndarray, np.ndarray]


def true_walk(response: np.ndarray) -> np.ndarray:
    return 8.0 / (1.0 + np.exp((response - 13.0) / 3.5))


def series(levels: np.ndarray, noise_mm: float, seed: int, readings: int = 200) -> list[Level]:
    rng = np.random.default_rng(seed)
    return [
        (level + rng.normal(0, 0.1, readings), float(true_walk(level)) + rng.normal(0, noise_mm, readings))
        for level in levels
    ]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_meets_responses_between_the_levels_within_its_uncertainty(seed: int) -> None:
    walk = fit_walk(series(np.geomspace(10, 66, 12), 0.1, seed))
    response = np.linspace(*walk.valid_mv, 200)
    found = walk.at(response)
    off = found.error_mm - true_walk(response)
    assert np.abs(off[response > 15]).max() < 0.1
    assert np.abs(off[response > 25]).max() < 0.05
    assert np.sqrt(np.mean((off / found.sd_mm) ** 2)) < 2


def test_it_falls_everywhere_even_from_noisy_levels() -> None:
    walk = fit_walk(series(np.geomspace(10, 66, 12), 3.0, 4))
    assert (np.diff(walk.at(np.linspace(*walk.valid_mv, 500)).error_mm) <= 1e-12).all()


def test_fewer_readings_give_a_greater_uncertainty() -> None:
    levels = np.geomspace(10, 66, 12)
    few, many = fit_walk(series(levels, 0.5, 5, 20)), fit_walk(series(levels, 0.5, 5, 2000))
    response = np.linspace(30, 60, 20)
    assert np.median(few.at(response).sd_mm) > 3 * np.median(many.at(response).sd_mm)


def test_it_is_valid_just_where_it_was_measured() -> None:
    walk = fit_walk(series(np.geomspace(20, 50, 6), 0.1, 6))
    assert walk.valid_mv == pytest.approx((20, 50), abs=0.1)


def test_the_order_of_the_levels_does_not_matter() -> None:
    levels = series(np.geomspace(10, 66, 8), 0.1, 7)
    assert fit_walk(levels) == fit_walk(levels[::-1])


def test_a_few_wild_readings_and_nan_do_not_count() -> None:
    clean = series(np.geomspace(10, 66, 8), 0.1, 8)
    wild = [(response, np.where(np.arange(response.size) < 5, [150.0], error)) for response, error in clean]
    wild[0][1][7] = np.nan
    at = np.geomspace(11, 60, 50)
    np.testing.assert_allclose(fit_walk(wild).at(at).error_mm, fit_walk(clean).at(at).error_mm, atol=0.05)


def test_too_little_is_refused() -> None:
    levels = series(np.geomspace(10, 66, 8), 0.1, 9)
    with pytest.raises(BadInput, match="at least 4 gray levels, not 3"):
        fit_walk(levels[:3])
    with pytest.raises(BadInput, match="gray level 2 has 5 usable readings"):
        fit_walk([*levels[:2], (levels[2][0][:5], levels[2][1][:5]), *levels[3:]])
    with pytest.raises(BadInput, match="without an echo"):
        fit_walk([*levels, (-levels[0][0], levels[0][1])])
    with pytest.raises(BadInput, match="same response"):
        fit_walk([*levels, levels[0]])
