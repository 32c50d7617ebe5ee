"""Places in a step across the lines of a raster, which only the line behind it shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from picoradar.instrument.line import Flag, in_step_of_raster
from picoradar.instrument.recording import cloud_of
from tests.instrument.recording_writer import make_line

NOISE_MM = 0.2


def stepped(range_mm: np.ndarray, order: np.ndarray | None = None) -> list[tuple[int, int]]:
    """Return rows and columns that are found in a step, whatever order the points come in."""
    rows, columns = (k.ravel().astype(np.int32) for k in np.indices(range_mm.shape))
    order = np.arange(range_mm.size) if order is None else order
    variance = np.full(range_mm.size, NOISE_MM**2)
    found = in_step_of_raster(range_mm.ravel()[order], variance, rows[order], columns[order])
    return sorted(zip(rows[order][found].tolist(), columns[order][found].tolist(), strict=True))


def edge(slope: float = 0.0, height_mm: float = 8.0) -> np.ndarray:
    """Return a raster 8 x 6 whose row 4 lies half way down a step across the lines."""
    rows = np.arange(8)[:, None]
    return 900.0 + slope * rows + height_mm * np.clip((rows - 3) / 2, 0.0, 1.0) + np.zeros((8, 6))


@pytest.mark.parametrize("slope", [0.0, 1.0, -1.0])
def test_a_step_that_the_next_line_shows(slope: float) -> None:
    assert {row for row, _ in stepped(edge(slope))} == {4}
    assert len(stepped(edge(slope))) == 6


@pytest.mark.parametrize("slope", [0.0, 1.0, 2.5])
def test_a_smooth_surface_has_next_to_none(slope: float) -> None:
    noise = NOISE_MM * np.random.default_rng(2).standard_normal((100, 100))
    # Beyond 4 standard deviations lie 0.3 of 10,000 normal deviates; three directions are looked at.
    assert len(stepped(900.0 + slope * np.arange(100)[:, None] + noise)) <= 3


def test_the_order_of_the_points_does_not_matter() -> None:
    shuffled = np.random.default_rng(3).permutation(48)
    assert stepped(edge(), shuffled) == stepped(edge())


def test_the_end_of_a_line_is_no_neighbour_of_the_beginning_of_the_next() -> None:
    sloped = 900.0 + 10.0 * np.arange(6) + np.zeros((8, 1))  # 50 mm from end to beginning
    assert stepped(sloped) == []


def test_places_without_a_range_show_nothing_and_are_not_flagged() -> None:
    surface = edge()
    surface[4, 2] = surface[0] = np.nan
    assert stepped(surface) == [(4, column) for column in (0, 1, 3, 4, 5)]


def test_at_the_border_the_surface_is_taken_to_go_on_as_on_the_other_side() -> None:
    surface = 900.0 + np.array([4.0, 0.0, 0.0, 0.0, 0.0, 0.0])[:, None] + np.zeros((6, 6))
    assert {row for row, _ in stepped(surface)} == {0}
    assert {row for row, _ in stepped(surface[::-1])} == {5}
    assert stepped(900.0 + 2.0 * np.arange(6)[:, None] + np.zeros((6, 6))) == []


def test_points_of_a_raster_alone_are_neighbours() -> None:
    lines = [
        replace(make_line(row, 3), range_mm=np.full(3, range_mm), range_variance_mm2=np.full(3, NOISE_MM**2))
        for row, range_mm in enumerate(edge()[:, 0])
    ]
    cloud = cloud_of(lines, raster=True)
    assert np.unique(cloud.rows[cloud.flags == Flag.MIXED]).tolist() == [4]
    assert not cloud_of(lines).flags.any()
