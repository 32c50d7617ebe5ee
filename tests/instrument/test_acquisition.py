"""Plans, captures and the job made of them, as far as they need no devices."""

from __future__ import annotations

import dataclasses
import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.traces import CodeScale, Trace, Window
from picoradar.instrument.acquisition import (
    Acquisition,
    Captured,
    MonitorPlan,
    PointsPlan,
    RasterPlan,
    Setup,
    monitor_scan,
    points_scan,
    raster_scan,
)
from picoradar.instrument.calibration import CENTRE_CODE, Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.ranging import Ranges
from picoradar.instrument.settings import Settings, override

SCALE = CodeScale(32.0, 0.5)
CODES = np.arange(2 * 3 * 2).reshape(2, 3, 2) * 100 + 1000


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    with resources.as_file(resources.files("picoradar.instrument") / "data" / "simulated-bench.json") as path:
        return Calibration.load(Path(path))


@pytest.fixture
def setup(calibration: Calibration) -> Setup:
    return Setup(Settings(), calibration, VirtualClock())


def raster_part(job: Acquisition) -> dict[str, Any]:
    return dict(job.header({}, seed=None, scale=SCALE)["raster"])


def test_only_a_raster_has_a_step_in_its_header(setup: Setup) -> None:
    shared = {"mode": "sweep", "averages": 8, "estimator": "half-maximum"}
    points = {"rows": 2, "columns": 3, **shared}
    assert raster_part(points_scan(setup, CODES)) == {"plan": "points", **points}
    assert raster_part(monitor_scan(setup, CODES, 60.0)) == {"plan": "monitor", "interval_s": 60.0, **points}
    raster = {"plan": "raster", "rows": 40, "columns": 40, "step_mm": 1.0, "distance_mm": 900.0}
    assert raster_part(raster_scan(setup)) == {**raster, **shared}
    windows = {**raster, **shared, "mode": "window", "estimator": "template"}
    assert raster_part(raster_scan(setup, in_windows=True)) == windows


def test_points_are_gone_to_as_they_are(setup: Setup) -> None:
    plan = PointsPlan(CODES, setup.settings.scanner.field_deg)
    line = plan.line(1)
    assert line.codes.tolist() == CODES[1].tolist()
    assert line.lead_in.tolist() == CODES[1, 0].tolist()
    assert line.columns.tolist() == [0, 1, 2]
    np.testing.assert_allclose(line.angles_rad, (CODES[1] - CENTRE_CODE) / 4096 * np.deg2rad(10.0))


@pytest.mark.parametrize("interval_s", [0.1, 40.0])
def test_no_two_records_have_the_same_run_id(setup: Setup, interval_s: float) -> None:
    points = PointsPlan(CODES, 10.0)
    plans = (RasterPlan(2, 3, 1.0, 900.0), points, MonitorPlan(points, interval_s, 0.1446, setup.clock))
    for plan in plans:
        ids = [plan.run_id(row, column) for row in range(plan.rows) for column in range(plan.columns)]
        ids += [plan.run_id(plan.rows + row, 0) for row in range(plan.rows)]  # repeats
        assert ids[0] == 1
        assert len(set(ids)) == len(ids)
    assert plans[2].run_id(1, 0) == max(int(interval_s / 0.1446), 3) + 1


def test_a_monitored_line_waits_for_its_time_and_polls_meanwhile(setup: Setup) -> None:
    clock, polled = setup.clock, []
    plan = MonitorPlan(PointsPlan(CODES, 10.0), 25.0, 0.1446, clock)
    clock.sleep(7.0)  # warming up counts for nothing
    began = []
    for row in range(2):
        plan.wait_for(row, lambda: polled.append(clock.now()))
        began.append(clock.now())
        clock.sleep(3.0)
    assert began == [7.0, 32.0]
    assert polled == [10.0, 20.0, 30.0]


def test_what_a_job_knows_goes_through_json(setup: Setup) -> None:
    job, later = raster_scan(setup), raster_scan(setup)
    ranges = {"range_mm": [900.0, float("nan"), 901.0], "variance_mm2": [0.06, float("nan"), 0.07]}
    job.load_state({**job.state_dict(), "before": {"row": 4, **ranges}})
    later.load_state(json.loads(json.dumps(job.state_dict()).replace("NaN", "null")))
    assert repr(later.state_dict()) == repr(job.state_dict())
    assert later.state_dict()["before"]["row"] == 4


def test_the_state_in_recordings_of_earlier_versions_is_understood(setup: Setup) -> None:
    job = raster_scan(setup)
    job.load_state({"line": 2, "before": {"row": 2, "range_mm": [900.0, None]}})
    before = job.state_dict()["before"]
    assert before["row"] == 2
    assert before["variance_mm2"] == [0.0, 0.0]
    windows = raster_scan(setup, in_windows=True)
    with pytest.raises(KeyError):  # what the windows are planned from has always been there
        windows.load_state({"line": 2})


def test_lines_that_do_not_fit_into_memory_are_refused_whatever_the_plan(setup: Setup) -> None:
    long = override(setup.settings, {"sampler": {"samples": 16384}})
    with pytest.raises(BadInput, match="take fewer columns"):
        points_scan(dataclasses.replace(setup, settings=long), np.full((1, 1000, 2), CENTRE_CODE))


def test_room_for_raw_samples_is_reckoned_only_where_they_are_kept(setup: Setup) -> None:
    bare = dataclasses.replace(setup, settings=override(setup.settings, {"scan": {"keep_traces": False}}))
    assert raster_scan(setup).line_bytes == 40 * (256 + 2 * 1430)
    assert raster_scan(bare).line_bytes == raster_scan(bare, in_windows=True).line_bytes == 40 * 256
    assert 40 * 256 < raster_scan(setup, in_windows=True).line_bytes < raster_scan(setup).line_bytes


def test_codes_become_mv_by_zero_code_and_scale() -> None:
    sums = np.array([[256, 512], [264, 0]], dtype=np.uint16)
    traces = [Trace(row, 8, np.array([0.0, 6.7]), SCALE) for row in sums]
    together = Trace.stacked(traces)
    assert together.mv.tolist() == [[0.0, 16.0], [0.5, -16.0]]
    assert together.mv.dtype == np.float64
    assert traces[1].mv.tolist() == [0.5, -16.0]


def test_a_window_knows_its_shots_and_its_end() -> None:
    window = Window(4200.0, 6.7, 96, 3)
    assert window.shots(16) == 3 * 112
    assert window.end_ps == pytest.approx(4200.0 + 95 * 6.7)


class KnownLines:
    """A capture without devices: gives the ranges of each row, with one standard deviation."""

    mode, estimator, raw_bytes = "known", "template", 0

    def __init__(self, range_mm: np.ndarray, sd_mm: float) -> None:
        self._range_mm, self._sd_mm = range_mm, sd_mm

    def configure(self, sampler: Any) -> None:
        """Do nothing."""

    memory_s = 0.0

    def times_s(self, columns: int) -> tuple[float, float]:
        return 1.0, float(columns)

    def state_dict(self) -> dict[str, Any]:
        return {}

    def load_state(self, state: Any) -> None:
        """Do nothing."""

    def take(self, plan: Any, line: Any, revisit: Any, devices: Any) -> Captured:
        range_mm = self._range_mm[line.row]
        ones = np.ones(len(range_mm))
        flags = np.zeros(len(range_mm), dtype=np.uint16)
        ranges = Ranges(range_mm, self._sd_mm**2 * ones, 40 * ones, flags, 0 * ones, 7400 * ones, 30 * ones, ones)
        return Captured(ranges, sweeps=8, shots=100)


@pytest.mark.parametrize(("sd_mm", "found"), [(0.1, True), (1.0, False)])
def test_a_raster_is_judged_against_the_line_before_and_its_noise(setup: Setup, sd_mm: float, found: bool) -> None:
    """6 mm from line to line at a step of 1 mm exceed any surface; five sigma of two ranges are 7 mm at most."""
    lines = np.array([[900.0] * 5, [906.0] * 5, [912.0] * 5])

    def second_line(job: Acquisition) -> ScanLine:
        return job.take_line(1, None, None, lambda: None)  # type: ignore[arg-type]

    def job() -> Acquisition:
        plan = RasterPlan(3, 5, 1.0, 900.0)
        return Acquisition(plan, KnownLines(lines, sd_mm), setup)

    through, resumed = job(), job()
    first = through.take_line(0, None, None, lambda: None)  # type: ignore[arg-type]
    assert not first.flags.any()
    resumed.load_state(json.loads(json.dumps(through.state_dict())))
    for one in (through, resumed):
        assert ((second_line(one).flags & np.uint16(Flag.MIXED)) != 0).tolist() == [found] * 5
        assert one.shots in (100, 200)
        assert one.reference == (30.0, 7400.0)
    skipping = job()
    skipping.take_line(0, None, None, lambda: None)  # type: ignore[arg-type]
    assert not skipping.take_line(2, None, None, lambda: None).flags.any()  # type: ignore[arg-type]


def test_points_that_are_no_raster_are_not_judged_by_their_neighbours(setup: Setup) -> None:
    lines = np.array([[900.0, 950.0, 900.0, 950.0, 900.0], [700.0] * 5])
    job = Acquisition(PointsPlan(np.full((2, 5, 2), CENTRE_CODE), 10.0), KnownLines(lines, 0.1), setup)
    for row in range(2):
        assert not job.take_line(row, None, None, lambda: None).flags.any()  # type: ignore[arg-type]
