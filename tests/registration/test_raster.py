"""Rows and columns that the beams of a cloud still show, and neighbours and coarser clouds that follow from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.registration.errors import PointsError
from picoradar.registration.scan import Scan, checked_scan
from picoradar.registration.scan.raster import found_grid, neighbours, thinned


def lattice(
    rows: int, columns: int, *, turn_deg: float = 0.0, aspect: float = 1.0, slant: float = 0.0, tilt: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Unit beams (N, 3) on a raster of 1.1 mrad, and their rows and columns."""
    grid = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)
    place = 1.1e-3 * (grid - grid.mean(axis=0)) @ np.array([[1.0, 0.0], [slant, aspect]])
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    place = place @ np.array([[c, s], [-s, c]])
    beams = np.column_stack([place, np.ones(len(place))])
    beams = beams @ np.array([[np.cos(tilt), 0, -np.sin(tilt)], [0, 1, 0], [np.sin(tilt), 0, np.cos(tilt)]])
    return beams / np.linalg.norm(beams, axis=1, keepdims=True), grid


def same_neighbours(one: np.ndarray, other: np.ndarray) -> bool:
    return all(set(a) == set(b) for a, b in zip(one, other, strict=True))


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(8, 50),
    columns=st.integers(8, 50),
    turn_deg=st.floats(-90.0, 90.0),
    aspect=st.floats(0.7, 1.4),
    slant=st.floats(-0.2, 0.2),
    tilt=st.floats(-1.0, 1.0),
    missing=st.floats(0.0, 0.3),
    seed=st.integers(0, 2**16),
)
def test_a_raster_is_found_in_any_frame_order_and_shape(
    rows: int, columns: int, turn_deg: float, aspect: float, slant: float, tilt: float, missing: float, seed: int
) -> None:
    beams, grid = lattice(rows, columns, turn_deg=turn_deg, aspect=aspect, slant=slant, tilt=tilt)
    rng = np.random.default_rng(seed)
    kept = rng.permutation(len(beams))[: round((1.0 - missing) * len(beams))]
    beams, grid = beams[kept], grid[kept]
    found = found_grid(beams)
    assert found is not None
    steps = np.linalg.lstsq(grid - grid.mean(axis=0), found - found.mean(axis=0), rcond=None)[0]
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert abs(round(float(np.linalg.det(steps)))) == 1, "the same lattice, if by other steps"


@pytest.mark.parametrize("turn_deg", [0.0, 31.0])
def test_neighbours_of_the_found_raster_are_those_of_the_given_one(turn_deg: float) -> None:
    beams, grid = lattice(30, 40, turn_deg=turn_deg)
    hole = (np.abs(grid - [15, 20]) < 4).all(axis=1)
    beams, grid = beams[~hole], grid[~hole]
    assert same_neighbours(neighbours(beams, found_grid(beams)), neighbours(beams, grid))
    corner = int(np.flatnonzero((grid == 0).all(axis=1))[0])
    around = neighbours(beams, grid)[corner]
    assert sorted(grid[i].tolist() for i in around if i < len(grid)) == [[0, 1], [1, 0], [1, 1]]


def test_beams_that_waver_by_a_tenth_of_a_step_still_show_their_raster() -> None:
    beams, grid = lattice(40, 40)
    place = beams[:, :2] / beams[:, 2:] + np.random.default_rng(0).uniform(-1.1e-4, 1.1e-4, (len(beams), 2))
    found = found_grid(np.column_stack([place, np.ones(len(place))]))
    assert found is not None
    assert same_neighbours(neighbours(beams, found), neighbours(beams, grid))


@pytest.mark.parametrize("kind", ["random", "spiral", "line", "few"])
def test_what_is_no_raster_has_its_nearest_beams_for_neighbours(kind: str) -> None:
    rng = np.random.default_rng(3)
    k = np.arange(600.0)
    place = {
        "random": rng.uniform(-0.03, 0.03, (600, 2)),
        "spiral": 1.2e-3 * np.sqrt(k)[:, None] * np.stack([np.cos(2.4 * k), np.sin(2.4 * k)], axis=1),
        "line": np.stack([1e-3 * k, 0.0 * k], axis=1),
        "few": rng.uniform(-0.03, 0.03, (7, 2)),
    }[kind]
    beams = np.column_stack([place, np.ones(len(place))])
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    assert found_grid(beams) is None
    around = neighbours(beams, None)
    for index in range(0, len(beams), 97):
        distance = np.linalg.norm(place - place[index], axis=1)
        near = around[index][around[index] < len(beams)]
        assert len(near) > 0
        assert np.sort(distance[near])[-1] <= np.sort(distance)[len(near)] * (1 + 1e-9)


@settings(max_examples=40, deadline=None)
@given(rows=st.integers(20, 60), columns=st.integers(20, 60), every=st.integers(1, 40))
def test_a_thinned_raster_is_spread_evenly(rows: int, columns: int, every: int) -> None:
    grid = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)
    even = thinned(grid, every)
    assert even is not None
    chosen, coarse = even
    assert len(chosen) == pytest.approx(len(grid) / every, abs=2.0 * np.sqrt(len(grid) / every))
    places = grid[chosen].astype(float)
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() > 0.6 * np.sqrt(every), "no two of them closer than in a lattice of that density"
    assert len(np.unique(coarse, axis=0)) == len(coarse)


def test_a_thinned_scan_keeps_what_belongs_to_its_points() -> None:
    beams, _ = lattice(80, 70)
    points = 900.0 * beams
    covariance = np.tile(np.eye(3), (len(points), 1, 1)) * np.arange(1.0, len(points) + 1.0)[:, None, None]
    scan = checked_scan(points, covariance=covariance)
    thin = scan.thinned(1500)
    assert 1200 < len(thin) < 1500
    index = np.rint(thin.covariance[:, 0, 0] - 1.0).astype(int) if thin.covariance is not None else np.zeros(0, int)
    np.testing.assert_array_equal(thin.points, scan.points[index])
    assert (thin.around < len(thin)).sum(axis=1).mean() > 7.0
    assert scan.thinned(len(scan)) is scan
    assert isinstance(thin, Scan)


def checkerboard(grid: np.ndarray) -> np.ndarray:
    return np.asarray(grid.sum(axis=1) % 2 == 0)


def test_a_raster_with_holes_in_a_pattern_is_thinned_at_random() -> None:
    beams, grid = lattice(80, 80)
    kept = checkerboard(grid)
    scan = checked_scan(900.0 * beams[kept], grid=grid[kept])
    thin = scan.thinned(1600)
    assert len(thin) == 1600
    assert (thin.around < len(thin)).sum(axis=1).mean() > 6.0, "neighbours are the nearest then"


@pytest.mark.parametrize(("stride", "offset"), [((2, 2), (1, 0)), ((10, 3), (-7, 40)), ((1, 5), (0, 0))])
def test_rows_and_columns_may_be_counted_in_any_steps(stride: tuple[int, int], offset: tuple[int, int]) -> None:
    beams, grid = lattice(50, 48)
    plain = checked_scan(900.0 * beams, grid=grid)
    counted = checked_scan(900.0 * beams, grid=grid * stride + offset)
    np.testing.assert_array_equal(counted.around, plain.around)
    np.testing.assert_array_equal(counted.thinned(800).points, plain.thinned(800).points)


@pytest.mark.parametrize("far", [10**9, 2**62])
def test_a_grid_that_is_none_is_refused(far: int) -> None:
    beams, grid = lattice(20, 20)
    grid = grid.astype(np.int64)
    grid[0] = far
    grid[1] = -far
    with pytest.raises(PointsError, match="grid spans"):
        checked_scan(900.0 * beams, grid=grid)


@pytest.mark.parametrize("times", [2, 12])
def test_beams_that_come_more_than_once_are_no_raster(times: int) -> None:
    beams, _ = lattice(20, 20)
    assert found_grid(np.tile(beams, (times, 1))) is None


def test_beams_to_all_sides_are_refused() -> None:
    places = np.stack(np.meshgrid(*[np.arange(-1.0, 2.0)] * 3), axis=-1).reshape(-1, 3)
    with pytest.raises(PointsError, match="lies within the cloud"):
        checked_scan(30.0 * places[np.abs(places).max(axis=1) > 0])
    half = places[places[:, 2] >= 0]
    beams = half[np.abs(half).max(axis=1) > 0]
    beams = beams / np.linalg.norm(beams, axis=1, keepdims=True)
    assert found_grid(beams) is None
    assert neighbours(beams, None).shape == (len(beams), 8)
