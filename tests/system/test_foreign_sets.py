"""Sets of waveforms of other instruments, in bins of 1 ns with a truth: ranged with settings only.

The simulated radar, slowed down and binned, in both of its worlds, and drawn airborne waveforms
(`benchmarks/ranging_foreign.py`, whose table is in docs/foreign-traces.md).
"""

import numpy as np
import pytest

from benchmarks.ranging_foreign import CASES, PLAIN, Forest, Score, airborne, judge
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import (
    RANGE_PER_INTERVAL_MM_PER_PS,
    LearningSettings,
    OtherPulse,
    RangingSettings,
    estimate,
    learn_moving,
)

RECORDS = 200
BAR_NS = 0.15
# What the noise leaves (of 10 counts at a noise of 1.5, or 40 at 4), and templates of echoes of two widths: 10 % more
# than was measured with 400 records of each of two seeds.
LOOSER_NS = {
    ("airborne, 15 ns", "half-maximum"): 0.20,
    ("airborne, 10 bit, noise 4", "half-maximum"): 0.18,
    ("airborne, 10 bit, noise 4", "template"): 0.17,
    ("airborne, 10 ns", "template"): 0.23,
    ("airborne, 15 ns", "template"): 0.32,
    ("airborne, width told 30 % too small", "template"): 0.20,
}
OTHER = OtherPulse(fwhm_ps=5000.0, step_ps=1000.0, full_scale=PLAIN.full_scale)
SETTINGS, LEARNING = RangingSettings.for_pulse(OTHER), LearningSettings.for_pulse(OTHER)


@pytest.mark.parametrize("method", ["half-maximum", "template"])
@pytest.mark.parametrize("name", CASES)
def test_a_set_is_ranged_with_settings_only(name: str, method: str) -> None:
    score = judge(CASES[name], method, RECORDS, seed=31)
    assert score.ranged >= 0.95
    assert score.sd_ns <= LOOSER_NS.get((name, method), BAR_NS)
    assert score.unflagged <= RECORDS / 100  # of noise alone 1 in 1000 lies as far as that


def echoes(traces: np.ndarray, times_ps: np.ndarray, method: str, settings: RangingSettings = SETTINGS) -> np.ndarray:
    found = estimate(traces, times_ps, method=method, settings=settings, learning=LEARNING)
    return found.echo_ps - found.reference_ps


@pytest.mark.parametrize("method", ["half-maximum", "template"])
def test_an_offset_that_nobody_knows_and_pulses_that_go_down_change_nothing(method: str) -> None:
    given = airborne(Forest(lowest=30.0), PLAIN, 60, seed=4)
    expected = echoes(given.traces, given.times_ps, method)
    assert np.isfinite(expected).mean() > 0.95
    lifted = given.traces + np.arange(-90.0, 90.0, 3.0)[:, None]
    np.testing.assert_allclose(echoes(lifted, given.times_ps, method), expected, atol=0.1)
    downwards = 4095.0 - given.traces
    upright = RangingSettings.for_pulse(OtherPulse(fwhm_ps=5000.0, step_ps=1000.0, full_scale=(-4095.0, 0.0)))
    np.testing.assert_allclose(echoes(-downwards, given.times_ps, method, upright), expected, atol=0.1)


@pytest.mark.parametrize("method", ["half-maximum", "template"])
def test_shorter_traces_that_end_in_nan_are_ranged_like_whole_ones(method: str) -> None:
    given = airborne(Forest(lowest=30.0, further=0.0), PLAIN, 200, seed=6)
    cut = np.pad(given.traces, ((0, 0), (0, 150)), constant_values=np.nan)  # more than half of it is missing
    cut[::2, 110:] = np.nan
    times_ps = 1000.0 * (np.arange(cut.shape[1]) + 0.5)
    found = estimate(cut, times_ps, method=method, settings=SETTINGS, learning=LEARNING)
    score = Score.of(found, given.true_ps)
    assert score.ranged >= 0.98
    assert score.sd_ns <= BAR_NS
    assert score.unflagged == 0
    templates, _ = learn_moving(cut, times_ps, settings=SETTINGS, learning=LEARNING)
    assert templates.response_mv[-1] > 200.0


def test_nan_inside_a_trace_is_not_filled() -> None:
    given = airborne(Forest(lowest=30.0), PLAIN, 20, seed=7)
    given.traces[3, 60] = np.nan
    given.traces[5] = np.nan
    assert np.flatnonzero(np.isnan(echoes(given.traces, given.times_ps, "half-maximum"))).tolist() == [3, 5]
    own = estimate(np.full((1, 400), np.nan), 6.7 * np.arange(400.0))  # of the radar's own traces none is filled
    assert np.isnan(own.range_mm).all()


def test_one_record_whose_echo_runs_into_the_reference_does_not_spoil_the_shapes_of_the_others() -> None:
    given = airborne(Forest(lowest=30.0, further=0.0), PLAIN, 100, seed=8)
    given.traces[0] = np.maximum(given.traces[0], np.roll(given.traces[0], 7))
    score = Score.of(estimate(given.traces, given.times_ps, settings=SETTINGS, learning=LEARNING), given.true_ps)
    assert score.ranged >= 0.98
    assert score.sd_ns <= BAR_NS
    assert score.flagged < 0.3


def test_an_echo_whose_instant_is_less_certain_than_a_part_of_a_sample_is_of_low_response() -> None:
    case = airborne(Forest(fwhm_ns=10.0, length_ns=240, further=0.0), PLAIN, 200, seed=10, joined=False)
    wide = RangingSettings.for_pulse(OtherPulse(fwhm_ps=10_000.0, step_ps=1000.0, full_scale=PLAIN.full_scale))
    found = estimate(case.traces, case.times_ps, method="half-maximum", settings=wide, reference_ps=case.zero_ps)
    uncertain = np.sqrt(found.variance_mm2) / RANGE_PER_INTERVAL_MM_PER_PS > 150.0
    assert (uncertain & (found.response_mv > 30.0)).sum() > 10
    low = (found.flags & Flag.LOW_RESPONSE) != 0
    np.testing.assert_array_equal(low, uncertain | (found.response_mv < 30.0))


def test_counts_of_sixteen_bits_may_be_as_noisy_as_they_are() -> None:
    given = airborne(Forest(lowest=30.0, further=0.0), PLAIN, 100, seed=9)
    wide = OtherPulse(fwhm_ps=5000.0, step_ps=1000.0, code=200.0, full_scale=(-np.inf, np.inf))
    found = estimate(
        200.0 * given.traces,
        given.times_ps,
        settings=RangingSettings.for_pulse(wide),
        learning=LearningSettings.for_pulse(wide),
    )
    assert Score.of(found, given.true_ps).sd_ns <= BAR_NS
