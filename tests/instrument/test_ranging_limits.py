"""What the limits of ranging guard: those that no ordinary record reaches, each with a record that does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import NO_RANGE, Flag
from picoradar.instrument.ranging import (
    PlanSettings,
    Ranges,
    RangingSettings,
    WindowPlanner,
    WindowTraces,
    average_sweeps,
    estimate,
    estimate_windows,
    fit_walk,
    learn,
)

Receiver = Any  # SyntheticReceiver of conftest.py
HALF = "half-maximum"


def flags(found: Ranges) -> list[Flag]:
    return [Flag(int(f)) & ~Flag.WALK_EXTRAPOLATED for f in found.flags]


def test_sampling_instants_may_be_rounded_but_not_uneven() -> None:
    times = 6.7 * np.arange(200)
    rounded = np.round(times, 2)
    assert estimate(np.zeros((1, 200)), rounded).flags[0] == Flag.NO_REFERENCE
    times[100:] += 0.05
    with pytest.raises(BadInput, match="evenly spaced"):
        estimate(np.zeros((1, 200)), times)


def test_a_short_trace_of_fine_steps_is_judged_and_not_refused(receiver: Receiver) -> None:
    times = receiver.reference_ps + 0.5 * np.arange(100)  # one bin of 50 ps would be all of it
    found = estimate(receiver.traces(times, 4000.0, 45.0, records=3, seed=1), times, method=HALF)
    assert all(flag & Flag.NO_REFERENCE or flag & Flag.NO_ECHO for flag in flags(found))


@pytest.mark.parametrize("early_ps", [150.0, 600.0])
def test_the_baseline_is_right_also_with_the_reference_at_the_start(receiver: Receiver, early_ps: float) -> None:
    times = receiver.reference_ps - early_ps + 6.7 * np.arange(1200)
    traces = 8.0 + receiver.traces(times, 4000.0, 45.0, records=50, sweeps=8, seed=2)
    found = estimate(traces, times, method=HALF)
    assert flags(found) == [Flag.NONE] * 50
    assert found.reference_mv.mean() == pytest.approx(45.0, abs=0.3)
    assert found.response_mv.mean() == pytest.approx(45.0, abs=0.3)


@pytest.mark.parametrize(
    ("share", "after_peak_ps", "counts"), [(0.10, 850.0, False), (0.25, 1000.0, True), (0.10, 2000.0, True)]
)
def test_ringing_is_no_echo(receiver: Receiver, share: float, after_peak_ps: float, *, counts: bool) -> None:
    light = receiver.times_ps - receiver.reference_ps
    noise = np.random.default_rng(3).normal(0, 0.2, (20, light.size))
    bump = 45.0 * share * np.exp(-(((light - 450.0 - after_peak_ps) / 240.0) ** 2))  # 400 ps wide
    found = estimate(noise + receiver.pulse(light, 45.0) + bump, receiver.times_ps, method=HALF)
    assert {bool(flag & Flag.NO_ECHO) for flag in flags(found)} == {not counts}


@pytest.mark.parametrize(("pedestal", "touching"), [(0.02, False), (0.2, True)])
def test_pulses_that_touch_are_overlapped(receiver: Receiver, pedestal: float, *, touching: bool) -> None:
    times, light = receiver.times_ps, receiver.times_ps - receiver.reference_ps
    between = (light > 300.0) & (light < 2000.0)
    noise = np.random.default_rng(4).normal(0, 0.1, (20, times.size))
    pulses = receiver.pulse(light, 45.0) + receiver.pulse(light - 1700.0, 45.0)
    found = estimate(noise + np.maximum(pulses, 45.0 * pedestal * between), times, method=HALF)
    assert {bool(flag & Flag.OVERLAPPED) for flag in flags(found)} == {touching}


@pytest.mark.parametrize(("lowest_mv", "clipped"), [(-15.4, False), (-15.6, True)])
def test_the_low_end_of_the_converter_clips_too(receiver: Receiver, lowest_mv: float, *, clipped: bool) -> None:
    trace = receiver.signal(receiver.times_ps, 4000.0, 45.0)
    trace[-3] = lowest_mv
    assert bool(flags(estimate(trace[None], receiver.times_ps, method=HALF))[0] & Flag.CLIPPED) == clipped


def _windows(receiver: Receiver, before_ps: float, length: int, records: int, seed: int) -> tuple[WindowTraces, ...]:
    """Windows that begin so long before the 50 % point of the pulse."""
    late = receiver.half_ps(45.0)
    out = []
    for k, place in enumerate((receiver.reference_ps + late, receiver.reference_ps + 4120.77 + late)):
        before = before_ps if k else 200.0
        times = place - before + 6.7 * np.arange(length if k else 96)
        out.append(
            WindowTraces.of(receiver.traces(times, 4120.77, 45.0, records=records, seed=seed + k), times[0], 6.7)
        )
    return tuple(out)


@pytest.mark.parametrize(
    ("before_ps", "behind_ps", "seen"),
    [(95.0, 400.0, True), (65.0, 400.0, False), (200.0, 160.0, True), (200.0, 110.0, False)],
)
def test_foot_and_peak_must_be_inside_the_window(
    receiver: Receiver, calibrated: Calibration, before_ps: float, behind_ps: float, *, seen: bool
) -> None:
    length = round((before_ps + behind_ps) / 6.7)
    found = estimate_windows(*_windows(receiver, before_ps, length, 40, 5), calibration=calibrated)
    has_range = (found.flags & np.uint16(NO_RANGE)) == 0
    assert has_range.mean() > 0.95 if seen else has_range.mean() < 0.05


@pytest.mark.parametrize(("records", "shared"), [(7, False), (8, True)])
def test_a_reference_is_shared_by_eight_records_and_more(
    receiver: Receiver, calibrated: Calibration, records: int, *, shared: bool
) -> None:
    pair = _windows(receiver, 200.0, 96, records, 7)
    found = estimate_windows(*pair, calibration=calibrated, shared_reference=True)
    assert (np.ptp(found.reference_ps) == 0) == shared


def test_noise_is_learnt_right_also_from_coarse_steps(receiver: Receiver) -> None:
    """A polynomial of degree 4 through five samples would leave nothing of the noise."""
    times = receiver.times_ps[0] + 26.8 * np.arange(360)
    level = receiver.traces(times, 4000.0, 45.0, records=200, sweeps=1, seed=8)
    _, noise = learn([level], times, sweeps=1)
    assert noise.floor_mv == pytest.approx(receiver.floor_mv, rel=0.03)


def test_levels_without_noise_have_finite_weights(receiver: Receiver) -> None:
    clean = np.repeat(receiver.signal(receiver.times_ps, 4000.0, 45.0)[None], 20, axis=0)
    templates, noise = learn([clean], receiver.times_ps, sweeps=1)
    assert noise.floor_mv == pytest.approx(1e-3)
    assert np.isfinite(templates.reference).all()


@pytest.mark.parametrize(("step_ps", "ranged"), [(26.8, True), (60.0, False)])
def test_shapes_are_not_learnt_from_steps_that_do_not_show_them(
    receiver: Receiver, step_ps: float, *, ranged: bool
) -> None:
    times = receiver.times_ps[0] + step_ps * np.arange(round(9500 / step_ps))
    found = estimate(receiver.traces(times, 4000.0, 45.0, records=30, sweeps=8, seed=9), times, sweeps=8)
    assert {not flag & Flag.NO_ECHO for flag in flags(found)} == {ranged}


def test_one_shape_serves_responses_that_are_near_and_not_all(receiver: Receiver) -> None:
    """The edge slows down below 25 mV: with one shape for all, strong and weak echoes would not fit it."""
    traces = np.vstack(
        [receiver.traces(receiver.times_ps, 4000.0, a, records=60, sweeps=8, seed=int(a)) for a in (9.0, 60.0)]
    )
    found = estimate(traces, receiver.times_ps, sweeps=8)
    assert not any(flag & Flag.MIXED for flag in flags(found))


def test_a_walk_is_fitted_to_readings_without_scatter() -> None:
    levels = [(np.full(10, r), np.full(10, 8.0 / r)) for r in (10.0, 20.0, 40.0, 60.0)]
    levels = [(r + 1e-6 * np.arange(10), e + 1e-8 * np.arange(10)) for r, e in levels]
    assert fit_walk(levels).at(np.array([20.0])).error_mm[0] == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize(("extra", "out"), [(0.8, False), (2.5, True)])
def test_a_sweep_of_more_noise_is_left_out_when_noise_cannot_explain_it(extra: float, *, out: bool) -> None:
    rng = np.random.default_rng(10)
    sweeps = rng.normal(0, 0.6, (100, 8, 192))
    sweeps[:, 3] += rng.normal(0, extra * 0.6, (100, 192))
    assert average_sweeps(sweeps).left_out[:, 3].all() == out
    assert average_sweeps(sweeps).left_out[:, [0, 1, 2, 4, 5, 6, 7]].mean() < 0.01


def test_a_response_is_suspected_against_its_neighbours(calibrated: Calibration) -> None:
    blank = np.zeros(20)

    def lost(settings: PlanSettings) -> list[int]:
        planner = WindowPlanner(calibrated, 20, settings)
        reference = sum(calibrated.reference_ps or ()) / 2
        state = {"echo_ps": np.full(20, reference + 4000.0), "echo_before_ps": np.full(20, reference + 4000.0)}
        planner.load_state({**state, "response_mv": np.full(20, np.nan), "reference_ps": (reference, 20.0)})
        response = np.geomspace(20.0, 200.0, 20)  # falls by half within six points, which is no edge
        response[10] *= 0.6
        seen = Ranges(blank, blank, response, np.zeros(20, np.uint16), blank, blank, blank, blank)
        return planner.lost(planner.line(), seen).tolist()

    assert lost(PlanSettings()) == [10]
    assert 0 in lost(PlanSettings(neighbours=12))


def test_a_fit_starts_somewhere_where_a_window_is_flat(receiver: Receiver, calibrated: Calibration) -> None:
    flat = WindowTraces.of(np.zeros((2, 96)), 7000.0, 6.7)
    found = estimate_windows(flat, flat, calibration=calibrated, settings=RangingSettings())
    assert flags(found) == [Flag.NO_REFERENCE] * 2
