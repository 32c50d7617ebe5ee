"""Whatever a trace holds, ranging neither raises nor gives a range without a warrant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from picoradar.instrument.calibration import Calibration, Method
from picoradar.instrument.line import NO_RANGE, Flag
from picoradar.instrument.ranging import (
    PointWindows,
    Ranges,
    Window,
    WindowTraces,
    estimate,
    estimate_points,
    estimate_windows,
)

Receiver = Any  # SyntheticReceiver of conftest.py


def junk(rng: np.random.Generator, receiver: Receiver, records: int, samples: int) -> np.ndarray:
    """Traces of noise of any size with offsets, slopes, spikes, waves, pulses of either sign, clipping, or NaN."""
    place = np.arange(samples)
    times = 6500.0 + 6.7 * place
    out = rng.normal(0, rng.choice([0, 1e-9, 0.5, 5, 1e3, 1e8], (records, 1)), (records, samples))
    for trace in out:
        match rng.integers(0, 8):
            case 1:
                trace += rng.uniform(-200, 200)
            case 2:
                trace += np.linspace(0, rng.uniform(-100, 100), samples)
            case 3:
                trace[rng.integers(0, samples, 5)] += rng.choice([50, 1e6, -50], 5)
            case 4:
                trace += rng.uniform(0, 100) * np.sin(place / rng.uniform(1, 100))
            case 5:
                for _ in range(rng.integers(1, 6)):
                    trace += receiver.pulse(times - rng.uniform(6000, 16000), rng.uniform(-60, 100))
            case 6:
                np.round(np.clip(10 * trace, -16, 111.5), out=trace)
            case 7:
                trace[rng.integers(0, samples)] = rng.choice([np.nan, np.inf, -np.inf])
    return out


def check(ranges: Ranges) -> None:
    refused = (ranges.flags & np.uint16(NO_RANGE)) != 0
    for values in (ranges.range_mm, ranges.variance_mm2, ranges.response_mv, ranges.bias_sd_mm, ranges.echo_ps):
        assert np.isnan(values[refused]).all()
        assert np.isfinite(values[~refused]).all()
    assert (ranges.variance_mm2[~refused] > 0).all()


@pytest.mark.parametrize("seed", range(12))
def test_whole_traces(receiver: Receiver, calibrated: Calibration, seed: int) -> None:
    rng = np.random.default_rng(seed)
    samples = int(rng.choice([64, 70, 200, 700, 1430]))
    times = 6500.0 + float(rng.choice([1.0, 6.7, 20.0, 60.0])) * np.arange(samples)
    traces = junk(rng, receiver, 24, samples)
    for calibration in (calibrated, None):
        check(estimate(traces, times, method="half-maximum", calibration=calibration))
        check(estimate(traces, times, method="template", calibration=calibration))


@pytest.mark.parametrize("seed", range(12))
def test_windows(receiver: Receiver, calibrated: Calibration, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    samples, step_ps = int(rng.choice([12, 20, 96, 300])), float(rng.choice([1.0, 6.7, 26.8]))
    first, second = (
        WindowTraces.of(junk(rng, receiver, 24, samples), start, step_ps) for start in (receiver.reference_ps, 11_000.0)
    )
    for shared in (False, True):
        check(estimate_windows(first, second, calibration=calibrated, shared_reference=shared))


def wrong_inputs(receiver: Receiver, times_ps: np.ndarray, pulses_ps: tuple[float, ...]) -> dict[str, np.ndarray]:
    """Traces that are wrong, by name; ``pulses_ps`` are the places of reference, echo and a second echo."""
    noise = np.random.default_rng(8).normal(0.0, 0.6, times_ps.size)
    pulses = [receiver.pulse(times_ps - place, 45.0) for place in pulses_ps]
    return {
        "zeros": np.zeros(times_ps.size),
        "noise": noise,
        "saturated": np.full(times_ps.size, 111.5),
        "one pulse": pulses[0] + noise,
        "three pulses": sum(pulses) + noise,
        "wrong length": (pulses[0] + pulses[1] + noise)[:-7],
        "not a number": np.where(np.arange(times_ps.size) == 5, np.nan, pulses[0] + pulses[1] + noise),
    }


@pytest.mark.parametrize("method", ["half-maximum", "template"])
def test_each_wrong_trace_has_its_flag(receiver: Receiver, calibrated: Calibration, method: Method) -> None:
    times, reference = receiver.times_ps, receiver.reference_ps
    wrong = wrong_inputs(receiver, times, (reference, reference + 4000.0, reference + 5600.0))
    found = estimate(list(wrong.values()), times, method=method, calibration=calibrated)
    flags = {name: Flag(int(value)) for name, value in zip(wrong, found.flags, strict=True)}
    assert flags == {
        "zeros": Flag.NO_REFERENCE,
        "noise": Flag.NO_REFERENCE,
        "saturated": Flag.NO_REFERENCE | Flag.CLIPPED,
        "one pulse": Flag.NO_ECHO,
        "three pulses": Flag.MIXED,
        "wrong length": Flag.NO_REFERENCE,
        "not a number": Flag.NO_REFERENCE,
    }
    assert np.isfinite(found.range_mm).tolist() == [name == "three pulses" for name in wrong]


@pytest.mark.parametrize("wide", [False, True])
def test_each_wrong_window_has_its_flag(receiver: Receiver, calibrated: Calibration, wide: bool) -> None:
    half, reference = receiver.half_ps(45.0), receiver.reference_ps
    near = Window(round(reference + half - 200.0, 1), 10.0, 60, 1)
    echo = Window(round(reference + half + 3800.0, 1), 13.4, 300 if wide else 60, 1)
    own = near.start_ps + near.step_ps * np.arange(near.samples)
    good = receiver.pulse(own - reference, 45.0) + np.random.default_rng(2).normal(0.0, 0.6, own.size)
    times = echo.start_ps + echo.step_ps * np.arange(echo.samples)
    second = 5600.0 if wide else 4260.0  # in the narrow window the two make one form that is not that of a pulse
    wrong = wrong_inputs(receiver, times, (reference, reference + 4000.0, reference + second))
    place = PointWindows(near, echo, wide=wide)
    found = estimate_points([place] * len(wrong), [(good, trace) for trace in wrong.values()], calibration=calibrated)
    flags = {name: Flag(int(value)) for name, value in zip(wrong, found.flags, strict=True)}
    flags["three pulses"] &= ~Flag.WALK_EXTRAPOLATED  # two in one form may be brighter than what was calibrated
    assert flags == {
        "zeros": Flag.NO_ECHO,
        "noise": Flag.NO_ECHO,
        "saturated": Flag.NO_ECHO | Flag.CLIPPED,
        "one pulse": Flag.NO_ECHO,
        "three pulses": Flag.MIXED,
        "wrong length": Flag.NO_ECHO,
        "not a number": Flag.NO_ECHO,
    }
    assert np.isfinite(found.range_mm).tolist() == [name == "three pulses" for name in wrong]
    swapped = estimate_points([PointWindows(echo, near, wide=wide)], [(wrong["noise"], good)], calibration=calibrated)
    assert Flag(int(swapped.flags[0])) == Flag.NO_REFERENCE
