"""Codes that come out of the whole chain, judged by the dissertation's numbers."""

from __future__ import annotations

import numpy as np
import pytest

READINGS = 1600


def reflectance_for(make_bench, response_mv: float, distance_mm: float) -> float:
    """Response is nearly proportional to reflectance; two secant steps find it."""
    level = 0.5
    for _ in range(3):
        bench = make_bench(distance_mm=distance_mm, reflectance=level)
        bench.record(1)
        level *= response_mv / bench.optics.truth[(1, 0, 0)].response_mv
    return level


def test_uncertainty_at_one_metre_is_a_quarter_of_a_millimetre(make_bench):
    bench = make_bench(seed=20, distance_mm=1000.0)
    intervals = np.array([bench.interval_mm(number) for number in range(1, READINGS + 1)])
    deviation = intervals - intervals.mean()
    assert 0.22 < deviation.std() < 0.32
    assert 0.7 < np.abs(deviation).max() < 1.2


@pytest.mark.parametrize("distance_mm", [650.0, 950.0])
def test_walk_is_small_above_25_mv_and_six_millimetres_at_15_mv(make_bench, distance_mm):
    errors = {}
    for response_mv in (15.0, 25.0, 60.0):
        bench = make_bench(distance_mm=distance_mm, reflectance=reflectance_for(make_bench, response_mv, distance_mm))
        readings = [bench.interval_mm(number) for number in range(1, 101)]
        errors[response_mv] = np.mean(readings) - bench.optics.truth[(1, 0, 0)].range_mm
    assert 5.0 < errors[15.0] - errors[60.0] < 7.0
    assert abs(errors[25.0] - errors[60.0]) < 1.0


def test_range_follows_the_target(make_bench):
    zeros = []
    for distance_mm in (640.0, 820.0, 1000.0):
        bench = make_bench(distance_mm=distance_mm, reflectance=0.5 * (distance_mm / 1000) ** 2, repeatability_deg=0.0)
        intervals = [bench.interval_mm(number) for number in range(1, 51)]
        truth = bench.optics.truth[(1, 0, 0)]
        assert truth.range_mm == pytest.approx(distance_mm, abs=1e-9)
        zeros.append(truth.range_mm - np.mean(intervals))
    assert np.ptp(zeros) < 0.15


@pytest.mark.parametrize(("distance_mm", "overlapped"), [(590.0, True), (630.0, False)])
def test_reference_and_echo_overlap_below_62_cm(make_bench, distance_mm, overlapped):
    """Where the echo begins (10 % of its peak), is the reference back to within 1 % of its own?"""
    together = make_bench(distance_mm=distance_mm)
    alone = make_bench(distance_mm=1400.0, reflectance=1e-6)
    both, reference = (sum(b.trace_mv(n) for n in range(1, 201)) / 200 for b in (together, alone))
    echo = both - reference
    begins = int(np.argmax(echo > 0.02 * echo.max())) if echo.max() > 0 else 0
    left = np.abs(reference[begins : begins + 20]).max() / reference.max()
    assert (left > 0.01) == overlapped


def test_responses_of_the_socket(make_bench):
    for seed, distance_mm in ((3, 850.0), (4, 900.0)):
        bench = make_bench(seed=seed, target="hip", distance_mm=distance_mm, repeatability_deg=0.0)
        span = np.radians(bench.settings.field_deg / 2) * distance_mm
        responses = []
        for number, (x_mm, y_mm) in enumerate(np.mgrid[-18:19:6, -18:19:6].reshape(2, -1).T, start=1):
            bench.mirrors.command(x_mm / span, y_mm / span)
            bench.clock.sleep(0.05)
            bench.record(number, sweeps=1)
            responses.append(bench.optics.truth[(number, 0, 0)].response_mv)
        assert np.percentile(responses, 2) > 30.0
        assert max(responses) < 70.0


def test_same_key_same_codes_whenever_it_is_measured(make_bench):
    first, second = (make_bench(pulser_heat_share=0.0) for _ in range(2))  # nothing regulates the diode here
    second.clock.sleep(12.34)
    second.record(8)
    np.testing.assert_array_equal(first.record(7), second.record(7))
    assert not np.array_equal(first.record(7), first.record(8))


def test_no_light_without_gate_or_triggers_or_supply(make_bench):
    dark = []
    bench = make_bench()
    dark.append(bench.record(1, gate=False))
    bench.trigger.rate_hz = 0.0
    dark.append(bench.record(2))
    bench.trigger.rate_hz = 80e3
    bench.supply.volts = 0.0
    dark.append(bench.record(3))
    for sums in dark:
        codes = sums / 8
        assert codes.mean() == pytest.approx(32.0, abs=0.1)
        assert codes.max() < 35
    assert not bench.optics.clipped


def test_a_beam_that_misses_gives_the_reference_alone(make_bench):
    bench = make_bench(target="prism")
    bench.mirrors.command(0.9, 0.9)
    bench.clock.sleep(1.0)
    trace = bench.trace_mv(1)
    truth = bench.optics.truth[(1, 0, 0)]
    assert truth.range_mm == np.inf
    assert truth.response_mv == 0.0
    assert trace[:300].max() == pytest.approx(45.0, abs=1.5)
    assert np.abs(trace[420:]).max() < 1.5


def test_too_strong_an_echo_clips(make_bench):
    bench = make_bench(distance_mm=620.0, reflectance=1.0)
    sums = bench.record(1)
    assert bench.optics.clipped
    assert sums.max() == 8 * 255
    bench.record(2, gate=False)
    assert not bench.optics.clipped
