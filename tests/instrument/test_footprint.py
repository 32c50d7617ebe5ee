"""Places whose spot lies on more than one surface, told by their neighbours."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import LineBefore, Ranges, mark_footprint

NOISE_MM = 0.25  # of a range at half maximum with 8 averages


def mixed(
    range_mm: np.ndarray,
    response_mv: np.ndarray | None = None,
    *,
    step_mm: float = 1.0,
    before_mm: np.ndarray | None = None,
) -> list[int]:
    response = np.full(len(range_mm), 45.0) if response_mv is None else response_mv
    flags = np.full(len(range_mm), Flag.RETAKEN, dtype=np.uint16)
    ranges = Ranges(range_mm, np.full(len(range_mm), NOISE_MM**2), response, flags, *[range_mm] * 4)
    known = None if before_mm is None else LineBefore(before_mm, np.full(len(before_mm), NOISE_MM**2))
    found = mark_footprint(ranges, step_mm, known)
    assert (found.flags & Flag.RETAKEN).all()  # other flags stay
    assert found.flags.dtype == np.uint16
    return np.flatnonzero(found.flags & Flag.MIXED).tolist()


@pytest.mark.parametrize("slope", [0.0, 1.0, 2.0, -2.2])
def test_a_smooth_surface_is_one_surface(slope: float) -> None:
    noise = NOISE_MM * np.random.default_rng(1).standard_normal(1000)
    line = 900.0 + slope * np.arange(1000)
    assert mixed(line + noise) == []
    assert mixed(line + noise, before_mm=line + 2.0) == []


@pytest.mark.parametrize("between_mm", [0.2, 1.5, 4.0, 6.5, 7.8])
def test_a_spot_on_an_edge_has_neighbours_far_apart(between_mm: float) -> None:
    line = np.array([900.0, 900.0, 900.0, 900.0 + between_mm, 908.0, 908.0, 908.0])
    assert 3 in mixed(line)
    assert mixed(line[::-1]) == sorted(6 - k for k in mixed(line))
    assert set(mixed(line)) <= {2, 3, 4}


def test_an_edge_across_the_line_shows_against_the_line_before() -> None:
    line = np.full(5, 905.0)
    assert mixed(line, before_mm=np.array([905.0, 904.0, 901.0, np.nan, 909.0])) == [2, 4]


def test_the_spacing_of_the_places_counts() -> None:
    line = 900.0 + 2.0 * np.arange(6)
    assert mixed(line) == []
    assert mixed(line, step_mm=0.5) == [0, 1, 2, 3, 4, 5]


def test_half_a_spot_on_a_sloped_rim_is_not_where_the_beam_is() -> None:
    response = np.array([19.0, 34.0, 34.0, 34.0, 34.0, 20.0])
    sloped, flat = 900.0 + 2.0 * np.arange(6), np.full(6, 900.0)
    assert mixed(sloped, response) == [0, 5]
    assert mixed(flat, response) == []


def test_places_without_a_range_are_left_alone() -> None:
    line = np.array([900.0, np.nan, 908.0, 908.2, np.nan, np.nan])
    assert mixed(line) == []
    assert mixed(np.full(4, np.nan)) == []
    assert mixed(np.array([900.0])) == []


@pytest.mark.parametrize("step_mm", [0.01, 0.05, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_noise_is_no_slope_however_small_the_step(step_mm: float, slope: float) -> None:
    rng = np.random.default_rng(7)
    true_mm = 900.0 + slope * step_mm * np.arange(2000)
    line, before = true_mm + NOISE_MM * rng.standard_normal((2, 2000))
    assert mixed(line, step_mm=step_mm, before_mm=before) == []


@pytest.mark.parametrize("step_mm", [0.05, 0.1, 0.25, 0.5, 1.0])
def test_an_edge_of_8_mm_is_found_at_every_step(step_mm: float) -> None:
    """A spot that moves over an edge sees a mean of both sides, here in the shares that its two halves have."""
    rng = np.random.default_rng(8)
    x = step_mm * (np.arange(round(8.0 / step_mm)) - round(4.0 / step_mm)) + 0.01
    line = 900.0 + 8.0 * np.clip(0.5 + x, 0.0, 1.0) + NOISE_MM * rng.standard_normal(len(x))
    found = x[mixed(line, step_mm=step_mm)]
    assert np.abs(found).max() < 1.6  # not beyond a spot and a neighbour from the edge
    on_edge = np.flatnonzero(np.abs(x) < 0.25)
    assert set(on_edge.tolist()) <= set(mixed(line, step_mm=step_mm))


@pytest.mark.parametrize(("odd", "beside"), [(2, [1, 3]), (0, [0, 1]), (4, [3, 4])])
def test_a_doubtful_neighbour_proves_no_depth(odd: int, beside: list[int]) -> None:
    line = np.full(5, 900.0)
    line[odd] = 907.0
    for sd_mm, expected in ((NOISE_MM, beside), (2.0, [])):
        variance = np.full(5, NOISE_MM**2)
        variance[odd] = sd_mm**2
        flags = np.zeros(5, dtype=np.uint16)
        found = mark_footprint(Ranges(line, variance, np.full(5, 45.0), flags, *[line] * 4), 1.0, None)
        assert np.flatnonzero(found.flags & Flag.MIXED).tolist() == expected


def test_an_edge_beside_a_gap_shows_from_one_side_as_far_as_it_is_known() -> None:
    line = np.array([900.0, 907.0, np.nan, 900.0])
    for sd_mm, expected in ((NOISE_MM, [0, 1]), (2.0, [])):
        variance = np.array([sd_mm**2, NOISE_MM**2, np.nan, NOISE_MM**2])
        flags = np.zeros(4, dtype=np.uint16)
        found = mark_footprint(Ranges(line, variance, np.full(4, 45.0), flags, *[line] * 4), 1.0, None)
        assert np.flatnonzero(found.flags & Flag.MIXED).tolist() == expected
