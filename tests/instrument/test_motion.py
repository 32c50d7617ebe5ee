"""The watch for motion: no false alarm, and an alarm for what is greater than the noise."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from picoradar.instrument.acquisition import MotionMonitor
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import Ranges

SD_MM = 0.13


def ranges(range_mm: np.ndarray, flags: np.ndarray | None = None, sd_mm: float = SD_MM) -> Ranges:
    blank = np.full(len(range_mm), 40.0)
    none = np.isnan(range_mm)
    return Ranges(
        range_mm=range_mm,
        variance_mm2=np.where(none, np.nan, sd_mm**2),
        response_mv=blank,
        flags=np.where(none, Flag.NO_ECHO, 0).astype(np.uint16) if flags is None else flags,
        bias_sd_mm=blank,
        reference_ps=blank,
        reference_mv=blank,
        echo_ps=range_mm / 0.15,
    )


def watch(rows: int = 60) -> MotionMonitor:
    return MotionMonitor(rows, revisit_s=0.02, line_s=0.1, pointing_sd_mm=0.035)


def run(watched: MotionMonitor, moved_mm: np.ndarray, rng: np.random.Generator) -> list[bool]:
    """Take lines of a slope of 30 degrees; return after each whether the target counts as moved."""
    found = []
    for row, off in enumerate(moved_mm):
        look = ranges(np.array([900.0 + off + SD_MM * rng.standard_normal()])) if watched.due else None
        line = 900.0 + 0.6 * np.arange(20) + off + 0.2 * rng.standard_normal(20)
        watched.line_done(row, ranges(line), 1.0, look)
        found.append(watched.moved)
    return found


def test_looks_take_two_percent_of_the_time() -> None:
    assert watch().interval == 10
    watched = watch()
    looks = 0
    for row in range(60):
        look = ranges(np.array([900.0])) if watched.due else None
        looks += look is not None
        watched.line_done(row, ranges(np.full(20, 900.0)), 1.0, look)
    assert looks == 6  # after the lines 1, 11, 21, 31, 41 and 51


@pytest.mark.parametrize("seed", range(200))
def test_a_target_at_rest_raises_no_alarm(seed: int) -> None:
    assert not any(run(watch(), np.zeros(60), np.random.default_rng(seed)))


@pytest.mark.parametrize("step_mm", [-1.5, 1.5, 8.0])
def test_a_push_is_seen_and_stays(step_mm: float) -> None:
    found = run(watch(), np.where(np.arange(60) < 25, 0.0, step_mm), np.random.default_rng(1))
    assert not any(found[:25])
    assert all(found[31:])


def test_a_target_that_comes_back_counts_again() -> None:
    off = np.where((np.arange(60) > 15) & (np.arange(60) < 35), 2.0, 0.0)
    found = run(watch(), off, np.random.default_rng(2))
    assert found[21]
    assert not any(found[41:])


def test_an_echo_that_is_gone_is_motion_too() -> None:
    watched = watch()
    run(watched, np.zeros(11), np.random.default_rng(3))
    assert watched.due
    watched.line_done(11, ranges(np.full(20, 900.0)), 1.0, ranges(np.array([np.nan])))
    assert watched.moved


def test_the_place_is_a_good_one_where_the_target_is_flat() -> None:
    watched = watch()
    range_mm = 900.0 + 2.0 * np.arange(12)
    range_mm[7:10] = range_mm[8] + np.array([-0.1, 0.0, 0.1])
    range_mm[2:5] = 905.0
    flags = np.zeros(12, dtype=np.uint16)
    flags[3] = Flag.MIXED  # flat, but no single surface
    watched.line_done(4, ranges(range_mm, flags), 1.0, None)
    assert watched.point == (4, 8)
    nothing = watch()
    nothing.line_done(0, ranges(np.full(12, np.nan)), 1.0, None)
    assert nothing.point is None
    assert not nothing.due


def test_a_scan_too_short_for_a_second_look_is_not_watched() -> None:
    watched = watch(rows=11)
    assert not any(run(watched, np.linspace(0, 50, 11), np.random.default_rng(4)))
    assert watched.point is None


def test_it_goes_on_from_what_the_recording_holds() -> None:
    off = np.where(np.arange(60) < 25, 0.0, 3.0)
    whole, first, second = watch(), watch(), watch()
    expected = run(whole, off, np.random.default_rng(5))
    rng = np.random.default_rng(5)
    before = run(first, off[:14], rng)
    second.load_state(json.loads(json.dumps(first.state_dict())))
    assert dataclasses.asdict(second) == dataclasses.asdict(first)
    assert before + run(second, off[14:], rng) == expected


@pytest.mark.parametrize(("off_mm", "moved"), [(1.1, False), (1.3, True)])
def test_without_a_known_step_the_surface_may_be_steep(off_mm: float, moved: bool) -> None:
    """Five sigma of two ranges (0.13 mm each) and the pointing (0.035 mm) at a slope of 3 are 1.21 mm; at 0, 0.95."""
    monitor, column = watch(), np.full(12, 900.0)
    monitor.line_done(0, ranges(column), None, None)
    assert monitor.point is not None
    monitor.line_done(1, ranges(column), None, ranges(np.array([900.0])))
    monitor.line_done(2, ranges(column), None, ranges(np.array([900.0 + off_mm])))
    assert monitor.moved is moved
