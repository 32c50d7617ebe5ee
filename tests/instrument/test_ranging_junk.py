"""Whatever a trace holds, ranging neither raises nor gives a range without a warrant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from instrument.calibration import Calibration
from instrument.ranging import Ranges, WindowTraces, estimate, estimate_windows
from instrument.scan_line import NO_RANGE

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
