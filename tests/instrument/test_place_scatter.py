"""The bias of tissue differs from place to place: that belongs to the points, not to the noise of their ranges."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.instrument.line import StretchTerms, unstretched
from picoradar.instrument.procedures.penetration.step import Half, fit_lean, step_between

TERMS = StretchTerms(bias_mm=3.0, rest_mm=0.1, piece_sd=0.2, power=0.45, power_sd=0.05, law_sd=0.03, place_sd_mm=0.5)


def half(offset_mm: float, scatter_mm: float, seed: int) -> Half:
    rng = np.random.default_rng(seed)
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(40.0), np.arange(40.0)))
    z = 900.0 + 0.2 * x + offset_mm + rng.normal(0.0, scatter_mm, x.size)
    return Half(np.column_stack([x, y, z]), np.tile([0.0, 0.0, 1.0], (x.size, 1)), np.full(x.size, 45.0))


@pytest.mark.parametrize("place_sd_mm", [0.0, 0.3, 0.6])
def test_the_scatter_of_the_bare_half_beyond_that_of_the_painted_one_is_learnt(place_sd_mm: float) -> None:
    painted, bare = half(0.0, 0.1, 1), half(3.0, float(np.hypot(0.1, place_sd_mm)), 2)
    step = step_between(painted, bare, fit_lean(painted))
    assert step.place_sd_mm == pytest.approx(place_sd_mm, abs=0.03)


def test_paint_does_not_differ_from_place_to_place() -> None:
    rows, columns = (k.ravel().astype(np.int32) for k in np.indices((30, 30)))
    stretch = np.where(columns < 15, 0.0, 1.0)
    found = unstretched(TERMS, stretch, np.full(900, 0.01), rows, columns)
    assert found is not None
    deep = np.abs(columns - 15) > 5
    assert np.sqrt(found.place_variance_mm2[deep & (columns >= 15)]) == pytest.approx(0.5, rel=0.1)
    assert np.all(found.place_variance_mm2[deep & (columns < 15)] < 0.05**2)


def test_recordings_from_before_know_of_no_scatter() -> None:
    before = {name: value for name, value in TERMS._asdict().items() if name != "place_sd_mm"}
    assert StretchTerms.of(before).place_sd_mm == 0.0
