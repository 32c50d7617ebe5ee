"""Bins, baseline, noise and pulses of traces that can be worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from picoradar.instrument.ranging import RangingSettings
from picoradar.instrument.ranging.pulses import CoarseTraces, Pulses, coarse_traces, next_pulse

SETTINGS = RangingSettings()
STEP_PS = 12.5  # four samples in a bin of 50 ps
BIN_PS = 50.0


def trace(first_bin: int, *, ripple_mv: float, after_mv: float = 3.4) -> np.ndarray:
    """100 bins and 3 samples: 3.0 mV, a pulse of 20 bins and 50 mV, 3.4 mV; with a ripple that no bin's mean shows.

    The pulse begins one sample late, so that its edge lies inside its first bin.
    """
    values = np.full(403, 3.0)
    begin, end = 4 * first_bin, 4 * (first_bin + 20)
    values[end:] = after_mv
    values[begin + 1 : end] += 50.0
    return values + ripple_mv * (-1.0) ** np.arange(403)


@pytest.mark.parametrize("ripple_mv", [0.2, 1.0])
def test_baseline_and_noise_are_those_between_the_pulses(ripple_mv: float) -> None:
    found = coarse_traces(np.stack([trace(40, ripple_mv=ripple_mv)] * 2), STEP_PS, SETTINGS)
    assert (found.width, found.bin_ps, found.values_mv.shape) == (4, BIN_PS, (2, 100))
    noise = math.sqrt(2.0) * ripple_mv  # differences of 2 r, of variance 4 r^2 = 2 x 2 r^2
    assert found.noise_mv == pytest.approx(noise)
    assert found.step_mv == pytest.approx(max(2.0, 6.0 * noise / 2.0))
    assert found.baseline_mv == pytest.approx(3.0)  # the median of all bins is 3.4
    assert found.baseline_variance_mv2 == pytest.approx(noise**2 / (4 * 38))
    assert found.values_mv[0, [0, 39, 41, 59, 60, 99]] == pytest.approx([0.0, 0.0, 50.0, 50.0, 0.4, 0.4])
    assert found.values_mv[0, 40] == pytest.approx(37.5)


@pytest.mark.parametrize(("first_bin", "baseline_mv", "samples"), [(6, 3.0, 16), (5, 3.4, 800 / math.pi)])
def test_with_too_little_before_the_pulse_the_baseline_is_the_median(
    first_bin: int, baseline_mv: float, samples: float
) -> None:
    found = coarse_traces(trace(first_bin, ripple_mv=0.2)[None], STEP_PS, SETTINGS)
    assert found.baseline_mv[0] == pytest.approx(baseline_mv)
    assert found.baseline_variance_mv2[0] == pytest.approx(0.08 / samples)


@pytest.mark.parametrize(("bump_mv", "baseline_mv"), [(2.0, 0.5), (2.1, 0.0)])
def test_a_bin_of_just_the_significant_step_is_no_pulse(bump_mv: float, baseline_mv: float) -> None:
    """The level before it is the baseline only when it is one; else the median, here that of what comes after."""
    values = np.full(100, 0.5)
    values[:40], values[40] = 0.0, 0.5 + bump_mv
    found = coarse_traces(np.repeat(values, 4)[None], STEP_PS, SETTINGS)
    assert found.step_mv[0] == SETTINGS.min_response_mv
    assert found.baseline_mv[0] == pytest.approx(baseline_mv)


def test_the_noise_of_a_single_quiet_bin_is_its_own() -> None:
    """A staircase of 30 mV, with bins of 16 samples: only the middle step is the median, and it holds one jump."""
    stairs = np.repeat(30.0 * np.arange(9), 16)
    found = coarse_traces(stairs[None], BIN_PS / 16, SETTINGS)
    assert found.width == 16
    assert found.noise_mv[0] == pytest.approx(math.sqrt(30.0**2 / (2 * 16)))


def test_a_bin_is_a_sample_at_least_and_an_eighth_of_the_trace_at_most() -> None:
    assert coarse_traces(np.zeros((1, 80)), 200.0, SETTINGS).width == 1
    assert coarse_traces(np.zeros((1, 80)), 1.0, SETTINGS).width == 10
    assert coarse_traces(np.zeros((1, 4)), 1.0, SETTINGS).width == 1


def coarse(*rows: list[float], step_mv: float = 2.0) -> CoarseTraces:
    """Bins as given, filled with zeros to 40."""
    values = np.array([row + [0.0] * (40 - len(row)) for row in rows])
    each = np.ones(len(rows))
    return CoarseTraces(values, 4, BIN_PS, 0.0 * each, 0.1 * each, 0.5 * each, step_mv * each)


ORDINARY = [0.0, 0.0, 0.0, -0.5, 0.0, 1.0, 3.0, 10.0, 8.0, 4.0]


def test_a_pulse_has_its_rise_peak_and_end() -> None:
    found = next_pulse(coarse(ORDINARY), SETTINGS)
    assert (found.found[0], found.rise[0], found.peak[0], found.end[0]) == (True, 6, 7, 9)
    assert (found.height_mv[0], found.valley_mv[0]) == (10.0, -0.5)
    lead, trail = 6 + 2 / 7, 9 - 1 / 4
    assert found.fwhm_ps(coarse(ORDINARY))[0] == pytest.approx((trail - lead) * BIN_PS)


def test_the_width_is_from_the_last_bin_below_half_before_the_peak() -> None:
    row = [0.0, 0.0, 6.0, 4.0, 6.0, 10.0, 7.0, 6.0, 3.0]
    own = next_pulse(coarse(row), SETTINGS)
    assert (own.rise[0], own.peak[0], own.end[0]) == (2, 5, 8)
    lead, trail = 3.5, 8 - 2 / 3
    assert own.fwhm_ps(coarse(row))[0] == pytest.approx((trail - lead) * BIN_PS)


@pytest.mark.parametrize(
    ("row", "rise"),
    [
        ([0.0, 0.0, 2.0, 0.0], None),  # a rise of just the step is not more than it
        ([0.0, 0.0, 2.1, 0.0], 2),
        ([0.0, -3.0, 0.0, 1.9], None),  # it rises, and is not above the baseline
        ([0.0, -3.0, 0.0, 2.0], None),
        ([0.0, -3.0, 0.0, 2.1], 3),
        ([2.1, 0.0], 0),  # the trace begins inside a pulse
        ([2.0, 0.0], None),
        ([3.0, 3.5, 4.0, 5.0, 5.5, 5.5], 0),
    ],
)
def test_a_rise_is_significant_above_the_lowest_value_and_the_baseline(row: list[float], rise: int | None) -> None:
    found = next_pulse(coarse(row), SETTINGS)
    assert (int(found.rise[0]) if found.found[0] else None) == rise


def test_half_of_the_peak_is_not_yet_the_end() -> None:
    assert next_pulse(coarse([0.0, 10.0, 5.0, 4.9]), SETTINGS).end[0] == 3
    assert next_pulse(coarse([0.0, 4.0, 3.0, 10.0, 4.0]), SETTINGS).end[0] == 4  # 3 is not below half of 4


def test_a_pulse_that_is_cut_off_has_no_width() -> None:
    late = [0.0] * 37 + [5.0, 10.0, 9.0]
    rows = coarse([10.0, 8.0, 2.0], late, [0.0] * 40, ORDINARY)
    found = next_pulse(rows, SETTINGS)
    assert found.found.tolist() == [True, True, False, True]
    assert found.end[1] == 40
    assert np.isnan(found.fwhm_ps(rows)).tolist() == [True, True, True, False]


def test_the_next_pulse_is_looked_for_after_the_end_of_the_first() -> None:
    row = [0.0, 0.0, 3.0, 10.0, 8.0, 4.0, 4.5, 5.9, 7.0, 20.0, 12.0, 9.0]
    first = next_pulse(coarse(row), SETTINGS)
    second = next_pulse(coarse(row), SETTINGS, first)
    assert (first.peak[0], first.end[0]) == (3, 5)
    assert (second.found[0], second.rise[0], second.peak[0], second.end[0]) == (True, 8, 9, 11)
    assert (second.height_mv[0], second.valley_mv[0]) == (20.0, 4.0)
    third = next_pulse(coarse(row), SETTINGS, second)
    assert not third.found[0]
    assert not next_pulse(coarse(row), SETTINGS, replace(first, found=np.array([False]))).found[0]


@pytest.mark.parametrize(("height_mv", "found"), [(6.0, False), (6.1, True)])
def test_a_rise_of_just_the_step_above_a_valley_is_no_pulse(height_mv: float, *, found: bool) -> None:
    row = coarse([0.0, 0.0, 3.0, 10.0, 8.0, 4.0, height_mv, 4.0])
    assert bool(next_pulse(row, SETTINGS, next_pulse(row, SETTINGS)).found[0]) == found


@pytest.mark.parametrize(
    ("behind", "height_mv", "found"),
    [(23, 15.0, False), (23, 15.1, True), (24, 15.0, True), (24, 2.0, False), (24, 2.1, True)],
)
def test_ringing_within_1200_ps_must_be_above_its_share_of_the_pulse(
    behind: int, height_mv: float, *, found: bool
) -> None:
    row = [0.0, 0.0, 100.0] + [0.0] * 37
    row[2 + behind] = height_mv
    own = coarse(row)
    assert bool(next_pulse(own, SETTINGS, next_pulse(own, SETTINGS)).found[0]) == found


def test_a_step_above_the_ringing_share_counts_in_the_ringing_too() -> None:
    row = [0.0, 0.0, 100.0] + [0.0] * 37
    row[10] = 19.0
    own = coarse(row, step_mv=20.0)
    assert not next_pulse(own, SETTINGS, next_pulse(own, SETTINGS)).found[0]


def test_the_width_is_that_of_the_pulse_given() -> None:
    one = np.array([1])
    at = Pulses(np.array([True]), one, one, 38 + one, np.array([8.0]), np.zeros(1))
    flat = coarse([0.0, *[8.0] * 38, 2.0])
    assert at.fwhm_ps(flat)[0] == pytest.approx(((39 - 1 / 3) - 0.5) * BIN_PS)
