"""The step between two halves of a piece: known answers, and a standard deviation that is true."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.instrument.procedures.penetration.step import BLOCK_MM, Half, Step, fit_lean, step_between

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(-17.0, 18.0), np.arange(-7.0, 8.0)))
BEAMS = np.column_stack([X, Y, np.full_like(X, 900.0)]) / np.sqrt(X**2 + Y**2 + 900.0**2)[:, None]
PAINTED, BARE = X < -4.0, X > 4.0


def halves(
    slopes: tuple[float, float], step_mm: float, error_mm: np.ndarray | float = 0.0, middle_mm: float = 900.0
) -> tuple[Half, Half]:
    """Points on a plane through (0, 0, middle), the bare ones farther along their beams by the step."""
    a, b = slopes
    along = middle_mm / (BEAMS[:, 2] - a * BEAMS[:, 0] - b * BEAMS[:, 1]) + np.where(BARE, step_mm, 0.0) + error_mm
    points = along[:, None] * BEAMS
    bright = np.where(BARE, 50.0, 45.0)
    return tuple(Half(points[side], BEAMS[side], bright[side]) for side in (PAINTED, BARE))


def measured(painted: Half, bare: Half) -> Step:
    return step_between(painted, bare, fit_lean(painted))


@settings(max_examples=60, deadline=None)
@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-1.0, 8.0))
def test_the_step_is_along_the_beam_whatever_the_lean(a: float, b: float, step_mm: float) -> None:
    found = measured(*halves((a, b), step_mm))
    assert found.step_mm == pytest.approx(step_mm, abs=1e-9)
    assert found.sd_mm < 1e-9
    assert (found.painted, found.bare) == (13 * 15, 13 * 15)
    assert (found.painted_mv, found.bare_mv) == (45.0, 50.0)


def test_the_stated_deviation_is_true_with_errors_that_places_share() -> None:
    """400 pieces: noise of each reading, and an error that each place of 2 mm of the bare half shares."""
    rng = np.random.default_rng(7)
    places = np.unique(np.floor(np.column_stack([X, Y]) / 2.0), axis=0, return_inverse=True)[1].ravel()
    off = []
    for _ in range(400):
        shared = np.where(BARE, rng.normal(0, 0.5, places.max() + 1)[places], 0.0)
        found = measured(*halves((0.1, 1.0), 3.0, shared + rng.normal(0, 0.2, len(X))))
        off.append((found.step_mm - 3.0) / found.sd_mm)
    assert np.mean(off) == pytest.approx(0.0, abs=0.15)
    assert np.std(off) == pytest.approx(1.0, abs=0.25)  # of a dozen blocks a half: a deviation known to 15 %
    assert BLOCK_MM >= 2 * 2.0


def test_bare_places_do_not_turn_the_plane() -> None:
    """An error that grows across the bare half is the tissue's, and shifts the step by its mean alone."""
    painted, bare = halves((0.0, 0.0), 3.0, np.where(BARE, 0.05 * (X - 11.0), 0.0))
    assert measured(painted, bare).step_mm == pytest.approx(3.0, abs=1e-3)
