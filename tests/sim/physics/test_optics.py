"""Codes that come out of the whole chain, judged by the dissertation's numbers."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.sim.physics import Noise, SlowDrift
from picoradar.sim.physics.materials import paint

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
        assert codes.mean() == pytest.approx(32.0 + 0.2 + 0.13, abs=0.05)  # offset, and bow at 1/8 of the range
        assert codes.max() < 35
    assert not bench.optics.clipped


def test_a_beam_that_misses_gives_the_reference_alone(make_bench):
    bench = make_bench(target="prism", drift_ps=0.0)
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


def test_shots_below_the_spike_threshold_give_long_weak_pulses(make_bench):
    bench = make_bench(distance_mm=1000.0)
    bench.supply.volts = 225.0
    trace = bench.trace_mv(1, sweeps=64)[:500]  # the reference
    normal = make_bench(distance_mm=1000.0).trace_mv(1, sweeps=64)[:500]
    assert 0.5 < trace.max() < 0.4 * normal.max()
    above = np.nonzero(trace > trace.max() / 2)[0]
    assert np.ptp(above) * 6.7 > 800.0


def test_jitter_of_each_shot_moves_the_edge(make_bench):
    """On the edge of the reference, single shots scatter by slope times jitter, each on its own."""
    quiet = {"amplifier_noise_mv": 0.0, "current_noise": 0.0, "excess_noise_factor": 1.0, "background_nw": 0.0}
    bench = make_bench(trigger_jitter_ps=12.0, drift_ps=0.0, **quiet)
    shots = np.array([bench.trace_mv(number, sweeps=1) for number in range(1, 401)])
    mean = shots.mean(axis=0)
    edge = int(np.argmax(mean > 22.0))
    slope = (mean[edge + 1] - mean[edge - 1]) / 13.4
    assert shots[:, edge].std() == pytest.approx(12.0 * slope, rel=0.1)
    assert abs(np.corrcoef(shots[:, edge], shots[:, edge + 1])[0, 1]) < 0.15


def test_lost_triggers_leave_holes(make_bench):
    whole, holed = (make_bench(lost_trigger_share=share).trace_mv(1, sweeps=64) for share in (0.0, 0.25))
    assert holed.max() / whole.max() == pytest.approx(0.75, abs=0.12)


def test_an_edge_under_the_spot_gives_two_echoes(make_bench):
    bench = make_bench(target="step", target_pose=(0.0, 0.0, 900.0, 0.0, 0.0, 0.0), repeatability_deg=0.0)
    ranges = []
    for number, x_mm in enumerate((-3.0, 0.0, 3.0), start=1):
        bench.mirrors.command(x_mm / 900.0 / np.radians(5.0), 0.0)
        bench.clock.sleep(0.1)
        ranges.append(bench.interval_mm(number, sweeps=64))
    low, middle, high = sorted(ranges)
    assert high - low == pytest.approx(10.0, abs=0.4)
    assert low + 1.0 < middle < high - 1.0
    assert ranges[1] == middle


def test_drift_moves_both_pulses_and_cancels(make_bench):
    bench = make_bench(drift_ps=60.0, drift_time_s=20.0, repeatability_deg=0.0)
    references, intervals = [], []
    for number in range(1, 801, 40):
        trace = bench.trace_mv(number)
        references.append(6500.0 + 6.7 * np.argmax(trace[:300] > 22.0))
        intervals.append(bench.interval_mm(number))
    assert np.std(references) > 20.0
    assert np.std(intervals) < 0.4


def test_slow_motion_of_the_target_shows_in_the_truth(make_bench):
    bench = make_bench(motion_mm=2.0, motion_period_s=4.0, repeatability_deg=0.0)
    ranges = []
    for number in range(1, 9):
        bench.record(number, sweeps=1)
        ranges.append(bench.optics.truth[(number, 0, 0)].range_mm)
        bench.clock.sleep(0.5)
    assert np.ptp(ranges) == pytest.approx(4.0, abs=0.3)


def test_noise_is_white_between_shots(make_bench):
    """Each sample is a shot of its own: no line and no slope in the spectrum of the dark trace."""
    bench = make_bench()
    spectra = [np.abs(np.fft.rfft(bench.record(n, sweeps=1, gate=False) - 32.2)) ** 2 for n in range(1, 201)]
    power = np.mean(spectra, axis=0)[1:-1]
    assert power.std() / power.mean() == pytest.approx(1 / np.sqrt(200), rel=0.25)
    assert power[:100].mean() == pytest.approx(power[-100:].mean(), rel=0.05)


def test_drift_is_red(make_bench):
    drift = SlowDrift(Noise(1), "sampler.drift", 1.0, 100.0)
    values = np.array([drift.at(t) for t in np.arange(0.0, 20000.0, 5.0)])
    assert values.std() == pytest.approx(1.0, abs=0.15)
    power = np.abs(np.fft.rfft(values - values.mean())) ** 2
    slow = np.fft.rfftfreq(len(values), 5.0) < 0.02
    assert power[slow].sum() > 0.99 * power.sum()


def test_light_budget_closes(make_bench):
    """Energy on the photodiode, counted from the diode on, against the area under the echo."""
    bench = make_bench(distance_mm=1000.0, spot_diameter_mm=0.0, reflectance=0.5, saturation_mv=1e4, drift_ps=0.0)
    s = bench.settings
    emitted_pj = 128.3 * 44.07 * 1.0645
    a, b, _, _ = paint(0.5).coefficients()
    assert b > 0
    aperture_sr = np.pi * (s.aperture_diameter_mm / 2) ** 2 / (1000.0 + s.mirror_separation_mm) ** 2
    on_diode_pj = emitted_pj * s.exit_transmission * s.receiver_transmission * a * aperture_sr / np.pi
    charge_fc = on_diode_pj * s.responsivity_a_per_w * s.avalanche_gain * 1e3
    dark = sum(bench.trace_mv(n, sweeps=64).sum() for n in range(1, 11))
    empty = make_bench(distance_mm=1000.0, spot_diameter_mm=0.0, reflectance=1e-6, drift_ps=0.0)
    dark -= sum(empty.trace_mv(n, sweeps=64).sum() for n in range(1, 11))
    assert dark / 10 * 6.7 / s.load_ohm == pytest.approx(charge_fc, rel=0.02)
