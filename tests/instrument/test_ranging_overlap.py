"""An echo in the tail of the reference: ranged without it by the template, flagged where it moves the half maximum."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import Ranges, WindowTraces, estimate, estimate_windows
from tests.instrument.conftest import SyntheticReceiver

RECORDS = 150
LEVELS_MV = np.geomspace(9.0, 70.0, 8)
NEAR_PS = (1500.0, 1300.0, 1150.0, 1050.0)


class Undershooting(SyntheticReceiver):
    """After its pulse the receiver swings to -6 % and back within 1.3 ns."""

    def pulse(self, t_ps: np.ndarray, response_mv: float) -> np.ndarray:
        tail = np.where(t_ps > 700.0, np.sin(np.clip((t_ps - 700.0) / 650.0, 0.0, 1.0) * np.pi), 0.0)
        return super().pulse(t_ps, response_mv) - 0.06 * response_mv * tail


@pytest.fixture(scope="module")
def undershooting() -> Undershooting:
    return Undershooting()


@pytest.fixture(scope="module")
def calibration(undershooting: Undershooting) -> Calibration:
    return undershooting.calibrate(LEVELS_MV, records=200, sweeps=8)


def from_whole(receiver: SyntheticReceiver, interval_ps: float, mv: float, calibrated: Calibration) -> Ranges:
    traces = receiver.traces(receiver.times_ps, interval_ps, mv, records=RECORDS, sweeps=8, seed=int(interval_ps))
    return estimate(traces, receiver.times_ps, method="template", calibration=calibrated, sweeps=8)


def from_windows(receiver: SyntheticReceiver, interval_ps: float, mv: float, calibrated: Calibration) -> Ranges:
    windows = []
    for k, light_ps in enumerate((receiver.reference_ps, receiver.reference_ps + interval_ps)):
        times = light_ps - 40.0 + 6.7 * np.arange(96)
        traces = receiver.traces(times, interval_ps, mv, records=RECORDS, sweeps=8, seed=int(interval_ps) + k)
        windows.append(WindowTraces.of(traces, times[0], 6.7, 8))
    return estimate_windows(*windows, calibration=calibrated)


@pytest.mark.parametrize("ranged", [from_whole, from_windows])
@pytest.mark.parametrize("mv", [15.0, 45.0])
@pytest.mark.parametrize("interval_ps", NEAR_PS)
def test_the_template_ranges_an_echo_without_the_tail_under_it(
    undershooting: Undershooting,
    calibration: Calibration,
    interval_ps: float,
    mv: float,
    ranged: Callable[[SyntheticReceiver, float, float, Calibration], Ranges],
) -> None:
    near, far = (ranged(undershooting, at, mv, calibration) for at in (interval_ps, 4003.1))
    error_mm = (near.range_mm - undershooting.range_mm(interval_ps)).mean()
    away_mm = (far.range_mm - undershooting.range_mm(4003.1)).mean()
    sd_mm = np.sqrt(near.variance_mm2.mean())
    assert abs(error_mm - away_mm) < 0.5 * sd_mm
    assert np.mean((near.flags & Flag.DISTORTED) != 0) <= 0.02
    assert np.mean((near.flags & Flag.MIXED) != 0) <= 0.03
    assert np.isnan(near.last_range_mm).mean() >= 0.97  # the reference is no echo


@pytest.mark.parametrize("mv", [15.0, 45.0])
@pytest.mark.parametrize("interval_ps", [*NEAR_PS, 1800.0, 2500.0])
def test_the_half_maximum_is_flagged_where_the_tail_moves_it_by_more_than_is_stated(
    undershooting: Undershooting, calibration: Calibration, interval_ps: float, mv: float
) -> None:
    def ranged(at_ps: float) -> Ranges:
        traces = undershooting.traces(undershooting.times_ps, at_ps, mv, records=600, sweeps=8, seed=7)
        return estimate(traces, undershooting.times_ps, method="half-maximum", calibration=calibration, sweeps=8)

    near, far = ranged(interval_ps), ranged(4003.1)
    moved_mm = np.mean(near.range_mm - undershooting.range_mm(interval_ps)) - np.mean(
        far.range_mm - undershooting.range_mm(4003.1)
    )
    flagged = np.mean((near.flags & Flag.OVERLAPPED) != 0)
    ratio = abs(moved_mm) / np.sqrt(near.variance_mm2.mean())
    if ratio > 1.15:  # the reference's own variance and the scatter of the mean are in the ratio, too
        assert flagged > 0.95
    elif ratio < 0.8:
        assert flagged < 0.05
