"""Ranging on the simulated optics, whose pulse and noise it knows only from their traces."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

from picoradar.instrument.calibration import METHODS, Calibration
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import estimate, fit_walk, learn
from picoradar.sim.validation import SWEEPS, TIMES_PS, Bench, painted

DISTANCE_MM = 1000.0
READINGS = 80


def readings(response_mv: float, seed: int, count: int = READINGS) -> tuple[np.ndarray, np.ndarray]:
    """Traces (R, S) and true ranges (R,) of a gray plate at 1 m."""
    bench = painted(seed, response_mv, target="plate", distance_mm=DISTANCE_MM)
    taken = [bench.take() for _ in range(count)]
    return np.stack([trace for trace, _ in taken]), np.array([truth.range_mm for _, truth in taken])


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    """Learnt from 9 gray levels before the simulated radar, as the bench procedure does it."""
    series = [readings(level, 500 + k) for k, level in enumerate(np.geomspace(11.0, 67.0, 9))]
    templates, noise = learn([traces for traces, _ in series], TIMES_PS, sweeps=SWEEPS)
    bare = Calibration(
        date=datetime.datetime(2026, 1, 31, tzinfo=datetime.UTC),
        provenance="simulated gray-target series",
        mirror_separation_mm=30.0,
        templates=templates,
        noise=noise,
    )
    walk = {}
    for method in METHODS:
        found = [estimate(x, TIMES_PS, method=method, calibration=bare, sweeps=SWEEPS) for x, _ in series]
        walk[method] = fit_walk([(r.response_mv, r.range_mm - t) for r, (_, t) in zip(found, series, strict=True)])
    return bare.model_copy(update={"walk": walk})


def test_at_one_metre_the_template_is_at_least_three_times_finer(calibration: Calibration) -> None:
    traces, true = readings(48.0, 901, 300)
    rms = {}
    for method in METHODS:
        found = estimate(traces, TIMES_PS, method=method, calibration=calibration, sweeps=SWEEPS)
        assert not found.flags.any()
        rms[method] = float(np.std(found.range_mm - true))
    assert rms["half-maximum"] == pytest.approx(0.27, abs=0.05)  # S 2.6.2: all of 1600 within 0.875 mm
    assert rms["template"] < 0.08


@pytest.mark.parametrize("response_mv", [15.5, 18.5, 22.0, 30.0, 52.0])
def test_after_calibration_the_walk_is_gone_at_other_gray_levels(calibration: Calibration, response_mv: float) -> None:
    traces, true = readings(response_mv, 950)
    found = estimate(traces, TIMES_PS, calibration=calibration, sweeps=SWEEPS)
    error = found.range_mm - true
    statistical = error.std() / np.sqrt(READINGS)
    assert abs(error.mean()) < (0.05 if response_mv >= 25 else 0.1) + 2 * statistical
    assert np.mean((error - error.mean()) ** 2 / found.variance_mm2) == pytest.approx(
        1.0, abs=4 * np.sqrt(2 / READINGS)
    )


def test_a_beam_into_the_void_has_no_range(calibration: Calibration) -> None:
    bench = Bench(7, target="prism", distance_mm=900.0)
    bench.aim(np.deg2rad(4.0), 0.0)
    traces = np.stack([bench.take()[0] for _ in range(5)])
    for method in METHODS:
        found = estimate(traces, TIMES_PS, method=method, calibration=calibration, sweeps=SWEEPS)
        assert set(found.flags) == {np.uint16(Flag.NO_ECHO)}
        assert np.isnan(found.range_mm).all()


def test_below_62_cm_the_pulses_overlap(calibration: Calibration) -> None:
    bench = Bench(7, target="plate", distance_mm=520.0, reflectance=0.3)
    found = estimate(bench.take()[0][None], TIMES_PS, calibration=calibration, sweeps=SWEEPS)
    assert int(found.flags[0]) & (Flag.OVERLAPPED | Flag.NO_ECHO)
