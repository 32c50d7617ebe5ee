"""The template estimator on whole traces: at the bound, with a true variance, and honest about what it cannot fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import estimate, learn

Receiver = Any  # SyntheticReceiver of conftest.py
INTERVAL = 4120.77


def test_the_bench_procedure_learns_the_noise(receiver: Receiver, calibrated: Calibration) -> None:
    assert calibrated.noise.floor_mv == pytest.approx(receiver.floor_mv, rel=0.02)
    assert calibrated.noise.jitter_ps == pytest.approx(receiver.jitter_ps, rel=0.05)
    assert calibrated.noise.signal_share == pytest.approx(receiver.share, rel=0.1)


def test_the_bench_procedure_learns_the_shapes(receiver: Receiver, calibrated: Calibration) -> None:
    shapes = calibrated.templates
    assert shapes is not None
    time = shapes.start_ps + shapes.step_ps * np.arange(len(shapes.reference))
    for amplitude, shape in zip(shapes.response_mv, shapes.echoes, strict=True):
        true = receiver.pulse(time + receiver.half_ps(amplitude), amplitude) / amplitude
        np.testing.assert_allclose(shape, true, atol=6 * receiver.floor_mv / np.sqrt(1600) / amplitude)


SINGLE_MIXED = 0.01  # share of single echoes that may be taken for two


@pytest.mark.parametrize(("response_mv", "sweeps"), [(15.0, 8), (25.0, 1), (45.0, 1), (45.0, 16), (65.0, 8)])
def test_repeated_readings_reach_the_bound_and_have_the_variance_told(
    receiver: Receiver, calibrated: Calibration, response_mv: float, sweeps: int
) -> None:
    readings = 3000
    without_walk = calibrated.model_copy(update={"walk": {}})
    traces = receiver.traces(receiver.times_ps, INTERVAL, response_mv, records=readings, sweeps=sweeps, seed=21)
    found = estimate(traces, receiver.times_ps, method="template", calibration=without_walk, sweeps=sweeps)
    spread = found.range_mm - found.range_mm.mean()
    uncertainty = 3 * np.sqrt(2 / readings)  # of a mean square of so many readings
    assert spread.var() / receiver.bound_mm2(receiver.times_ps, INTERVAL, response_mv, sweeps) < 1.10 + uncertainty / 2
    assert np.mean(spread**2 / found.variance_mm2) == pytest.approx(1.0, abs=uncertainty)


@pytest.mark.parametrize("response_mv", [52.0, 54.0, 56.0, 58.0])  # over a whole rung of the table of shapes
def test_neither_range_nor_variance_depends_on_where_the_amplitude_stands_in_the_table(
    receiver: Receiver, calibrated: Calibration, response_mv: float
) -> None:
    bare = calibrated.model_copy(update={"walk": {}})
    traces = receiver.traces(receiver.times_ps, INTERVAL, response_mv, records=400, sweeps=8, seed=6)
    found = estimate(traces, receiver.times_ps, method="template", calibration=bare, sweeps=8)
    bound = receiver.bound_mm2(receiver.times_ps, INTERVAL, response_mv, 8)
    assert found.variance_mm2.mean() / bound == pytest.approx(1.0, abs=0.025)
    # The fit starts from the half-maximum points, whose error is five times its own. Nothing of it may be left: what
    # an efficient estimate and a worse one have in common is the error of the efficient one.
    crossing = estimate(traces, receiver.times_ps, method="half-maximum", calibration=bare, sweeps=8)
    common = np.polyfit(crossing.range_mm, found.range_mm, 1)[0]
    assert common == pytest.approx(found.range_mm.var() / crossing.range_mm.var(), abs=0.035)


def test_it_is_many_times_better_than_half_maximum(receiver: Receiver, calibrated: Calibration) -> None:
    traces = receiver.traces(receiver.times_ps, INTERVAL, 45.0, records=500, sweeps=8, seed=3)
    template = estimate(traces, receiver.times_ps, method="template", calibration=calibrated, sweeps=8)
    crossing = estimate(traces, receiver.times_ps, method="half-maximum", calibration=calibrated, sweeps=8)
    assert template.range_mm.std() < 0.08
    assert crossing.range_mm.var() > 15 * template.range_mm.var()


@pytest.mark.parametrize("response_mv", [12.0, 15.3, 17.1, 19.0, 23.6, 28.0, 41.0, 57.0])
def test_the_walk_is_corrected_at_responses_that_were_not_calibrated(
    receiver: Receiver, calibrated: Calibration, response_mv: float
) -> None:
    traces = receiver.traces(receiver.times_ps, INTERVAL, response_mv, records=400, sweeps=8, seed=31)
    found = estimate(traces, receiver.times_ps, method="template", calibration=calibrated, sweeps=8)
    bias = found.range_mm.mean() - receiver.range_mm(INTERVAL)
    assert abs(receiver.range_mm(0.0, response_mv)) < 10  # what there is to correct
    assert abs(bias) < (0.05 if response_mv >= 25 else 0.1)
    assert abs(bias) < 4 * np.hypot(found.bias_sd_mm.mean(), found.range_mm.std() / 20)
    assert set(found.flags & ~np.uint16(Flag.MIXED)) <= {np.uint16(0), np.uint16(Flag.LOW_RESPONSE)}
    assert np.mean((found.flags & Flag.MIXED) != 0) <= SINGLE_MIXED


def test_the_variance_holds_where_the_walk_is_steep(receiver: Receiver, calibrated: Calibration) -> None:
    traces = receiver.traces(receiver.times_ps, INTERVAL, 16.0, records=3000, sweeps=8, seed=77)
    found = estimate(traces, receiver.times_ps, method="template", calibration=calibrated, sweeps=8)
    spread = found.range_mm - found.range_mm.mean()
    assert np.mean(spread**2 / found.variance_mm2) == pytest.approx(1.0, abs=0.08)


def test_a_misfired_shot_is_left_out(receiver: Receiver, calibrated: Calibration) -> None:
    traces = receiver.traces(receiver.times_ps, INTERVAL, 45.0, records=300, sweeps=8, seed=5)
    edge = receiver.reference_ps + INTERVAL + receiver.half_ps(45.0)
    place = round((edge - receiver.times_ps[0]) / 6.7) + 5
    struck = traces.copy()
    struck[:, place] -= traces[:, place] / 8
    good = estimate(traces, receiver.times_ps, method="template", calibration=calibrated, sweeps=8)
    mended = estimate(struck, receiver.times_ps, method="template", calibration=calibrated, sweeps=8)
    assert np.abs(mended.range_mm - good.range_mm).mean() < 0.02
    assert not mended.flags.any()


@pytest.mark.parametrize("apart_ps", [120.0, 250.0, 450.0])
def test_two_surfaces_in_the_footprint_do_not_have_the_shape_of_one(
    receiver: Receiver, calibrated: Calibration, apart_ps: float
) -> None:
    one = receiver.traces(receiver.times_ps, INTERVAL, 30.0, records=50, sweeps=8, seed=6)
    two = one + receiver.pulse(receiver.times_ps - receiver.reference_ps - INTERVAL - apart_ps, 25.0)
    found = estimate(two, receiver.times_ps, method="template", calibration=calibrated, sweeps=8)
    assert ((found.flags & Flag.MIXED) != 0).all()


def test_what_has_no_pulses_is_flagged_as_before(receiver: Receiver, calibrated: Calibration) -> None:
    times = receiver.times_ps
    noise = np.random.default_rng(1).normal(0, 0.6, (3, times.size))
    alone = noise + receiver.pulse(times - receiver.reference_ps, 45.0)
    found = estimate(
        np.vstack([noise, alone, np.zeros((1, times.size)), np.full((1, times.size), 111.5)]),
        times,
        method="template",
        calibration=calibrated,
    )
    assert [Flag(int(f)) for f in found.flags] == [Flag.NO_REFERENCE] * 3 + [Flag.NO_ECHO] * 3 + [
        Flag.NO_REFERENCE,
        Flag.NO_REFERENCE | Flag.CLIPPED,
    ]
    assert np.isnan(found.range_mm).all()
    assert np.isnan(found.variance_mm2).all()


def test_it_says_what_it_needs(receiver: Receiver, calibrated: Calibration) -> None:
    traces = receiver.traces(receiver.times_ps, INTERVAL, 45.0, records=1, seed=5)
    with pytest.raises(BadInput, match="calibration with templates"):
        estimate(traces, receiver.times_ps, calibration=calibrated.model_copy(update={"templates": None}))


@pytest.mark.parametrize("records", [1, 5, 400])
def test_without_any_calibration_the_records_themselves_give_the_shapes(receiver: Receiver, records: int) -> None:
    traces = receiver.traces(receiver.times_ps, INTERVAL, 45.0, records=records, sweeps=8, seed=14)
    found = estimate(traces, receiver.times_ps, sweeps=8)
    assert set(found.flags) == {np.uint16(Flag.WALK_EXTRAPOLATED)}
    np.testing.assert_allclose(found.range_mm, receiver.range_mm(INTERVAL), atol=1.0)
    assert found.response_mv.mean() == pytest.approx(45.0, rel=0.01)
    if records == 400:
        assert found.range_mm.std() < 0.08
        spread = found.range_mm - found.range_mm.mean()
        assert np.mean(spread**2 / found.variance_mm2) == pytest.approx(1.0, abs=0.25)


def test_without_any_calibration_and_any_pulse_there_is_no_range(receiver: Receiver) -> None:
    times = receiver.times_ps
    nothing = np.vstack([np.zeros(times.size), np.random.default_rng(1).normal(0, 0.6, times.size)])
    assert set(estimate(nothing, times).flags) == {np.uint16(Flag.NO_REFERENCE)}
    alone = nothing[1:] + receiver.pulse(times - receiver.reference_ps, 45.0)
    assert set(estimate(alone, times).flags) == {np.uint16(Flag.NO_ECHO)}


def test_templates_survive_the_file(receiver: Receiver, calibrated: Calibration, tmp_path: Any) -> None:
    calibrated.save(tmp_path / "cal.json")
    loaded = Calibration.load(tmp_path / "cal.json")
    traces = receiver.traces(receiver.times_ps, INTERVAL, 33.0, records=4, seed=9)
    ranges = [estimate(traces, receiver.times_ps, method="template", calibration=c) for c in (calibrated, loaded)]
    np.testing.assert_array_equal(ranges[0].range_mm, ranges[1].range_mm)
    assert (tmp_path / "cal.json").stat().st_size < 200_000


def test_learning_refuses_what_it_cannot_learn_from(receiver: Receiver) -> None:
    times = receiver.times_ps
    good = receiver.traces(times, 4000.0, 45.0, records=30, seed=1)
    with pytest.raises(BadInput, match="at least 20"):
        learn([good[:5]], times, sweeps=1)
    with pytest.raises(BadInput, match="no clear reference and echo"):
        learn([np.zeros((30, times.size))], times, sweeps=1)
    with pytest.raises(BadInput, match="same response"):
        learn([good, good], times, sweeps=1)
    with pytest.raises(BadInput, match="behind each for themselves"):
        learn([receiver.traces(times, 1700.0, 45.0, records=30, seed=1)], times, sweeps=1)
    with pytest.raises(BadInput, match="no gray level"):
        learn([], times, sweeps=1)
