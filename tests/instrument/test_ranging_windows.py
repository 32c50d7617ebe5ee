"""Windowed records: as good as their samples allow, and never a range for an echo that is not there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import (
    PlanSettings,
    PointWindows,
    Ranges,
    Window,
    WindowPlanner,
    WindowTraces,
    estimate_points,
    estimate_windows,
    with_retaken,
)
from picoradar.instrument.ranging.windows.fit import promised_sd_mm

Receiver = Any  # SyntheticReceiver of conftest.py
INTERVAL = 4120.77


def windows(
    receiver: Receiver, response_mv: float, records: int, seed: int, *, off_ps: float = 0.0, length: int = 96
) -> tuple[WindowTraces, WindowTraces]:
    """96 samples about each pulse; the echo's window ``off_ps`` too late."""
    out = []
    for k, start in enumerate((receiver.reference_ps + 20.0, receiver.reference_ps + INTERVAL + off_ps)):
        times = start - 110.0 + 6.7 * np.arange(length)
        values = receiver.traces(times, INTERVAL, response_mv, records=records, seed=seed + k)
        out.append(WindowTraces.of(values, times[0], 6.7))
    return out[0], out[1]


@pytest.mark.parametrize("response_mv", [20.0, 45.0])
def test_readings_reach_the_bound_of_their_samples(
    receiver: Receiver, calibrated: Calibration, response_mv: float
) -> None:
    reference, echo = windows(receiver, response_mv, 3000, 50)
    found = estimate_windows(reference, echo, calibration=calibrated.model_copy(update={"walk": {}}))
    times = np.concatenate([w.first_ps[0] + 6.7 * np.arange(96) for w in (reference, echo)])
    bound = receiver.bound_mm2(times, INTERVAL, response_mv)
    spread = found.range_mm - found.range_mm.mean()
    assert spread.var() / bound < 1.10 + 0.04
    assert np.mean(spread**2 / found.variance_mm2) == pytest.approx(1.0, abs=0.08)


def test_they_agree_with_whole_traces(receiver: Receiver, calibrated: Calibration) -> None:
    for off_ps in (-60.0, 0.0, 60.0):
        found = estimate_windows(*windows(receiver, 45.0, 2000, 60, off_ps=off_ps), calibration=calibrated)
        assert set(found.flags) <= {0, Flag.MIXED}
        assert np.mean(found.flags != 0) <= 0.01
        assert found.range_mm.mean() == pytest.approx(receiver.range_mm(INTERVAL), abs=0.03)


@pytest.mark.parametrize("off_ps", [-700.0, -420.0, 350.0, 900.0, 5000.0])
def test_an_echo_outside_its_window_gives_no_range(receiver: Receiver, calibrated: Calibration, off_ps: float) -> None:
    found = estimate_windows(*windows(receiver, 45.0, 300, 70, off_ps=off_ps), calibration=calibrated)
    trusted = found.flags == 0
    assert not trusted.any()
    lost = (found.flags & Flag.NO_ECHO) != 0
    assert np.isnan(found.range_mm[lost]).all()


def test_a_long_coarse_window_finds_the_echo(receiver: Receiver, calibrated: Calibration) -> None:
    reference, _ = windows(receiver, 45.0, 500, 80)
    times = receiver.reference_ps + 1800.0 + 26.8 * np.arange(140)
    search = WindowTraces.of(receiver.traces(times, INTERVAL, 45.0, records=500, seed=81), times[0], 26.8)
    found = estimate_windows(reference, search, calibration=calibrated)
    assert set(found.flags) <= {0, Flag.MIXED}
    assert np.mean(found.flags != 0) <= 0.01
    spread = found.range_mm - receiver.range_mm(INTERVAL)
    assert np.mean(spread**2 / found.variance_mm2) == pytest.approx(1.0, abs=0.2)


def test_noise_zeros_saturation_and_nan_have_no_range(receiver: Receiver, calibrated: Calibration) -> None:
    reference, echo = windows(receiver, 45.0, 4, 90)
    values = np.stack(
        [np.random.default_rng(1).normal(0, 0.6, 96), np.zeros(96), np.full(96, 111.5), np.full(96, np.nan)]
    )
    other = WindowTraces.of(values, echo.first_ps, 6.7)
    flags = [Flag(int(f)) for f in estimate_windows(reference, other, calibration=calibrated).flags]
    assert flags == [Flag.NO_ECHO, Flag.NO_ECHO, Flag.NO_ECHO | Flag.CLIPPED, Flag.NO_ECHO]
    found = estimate_windows(other, echo, calibration=calibrated)
    assert ((found.flags & Flag.NO_REFERENCE) != 0).all()
    assert np.isnan(found.range_mm).all()


def test_a_shared_reference_leaves_the_variance_of_the_echo(receiver: Receiver, calibrated: Calibration) -> None:
    pair = windows(receiver, 45.0, 2000, 100)
    own = estimate_windows(*pair, calibration=calibrated)
    shared = estimate_windows(*pair, calibration=calibrated, shared_reference=True)
    assert shared.variance_mm2.mean() < 0.65 * own.variance_mm2.mean()
    spread = shared.range_mm - shared.range_mm.mean()
    assert np.mean(spread**2 / shared.variance_mm2) == pytest.approx(1.0, abs=0.1)


def test_a_reference_that_moves_is_not_shared(receiver: Receiver, calibrated: Calibration) -> None:
    reference, echo = windows(receiver, 45.0, 40, 110)
    drift = np.linspace(0.0, 30.0, 40)  # both pulses come later and later; the windows follow
    moved = [WindowTraces.of(w.values_mv, w.first_ps + drift, 6.7) for w in (reference, echo)]
    own = estimate_windows(moved[0], moved[1], calibration=calibrated)
    asked = estimate_windows(moved[0], moved[1], calibration=calibrated, shared_reference=True)
    np.testing.assert_array_equal(own.range_mm, asked.range_mm)


def test_places_of_different_forms_come_back_in_their_order(receiver: Receiver, calibrated: Calibration) -> None:
    points, traces = [], []
    for k in range(12):
        step, sweeps = ((6.7, 1), (13.4, 2), (10.0, 1))[k % 3]
        spans = [
            Window(round(receiver.reference_ps - 100.0 + late, 1), step, int(600 / step), sweeps)
            for late in (0.0, INTERVAL + 10.0 * k)
        ]
        points.append(PointWindows(spans[0], spans[1], wide=False))
        traces.append(
            tuple(
                receiver.traces(
                    w.start_ps + step * np.arange(w.samples),
                    INTERVAL + 10.0 * k,
                    45.0,
                    records=1,
                    seed=k,
                    sweeps=sweeps,
                )[0]
                for w in spans
            )
        )
    traces[5] = (traces[5][0], traces[5][1][:-1])
    found = estimate_points(points, traces, calibration=calibrated)
    good = np.arange(12) != 5
    expected = np.array([receiver.range_mm(INTERVAL + 10.0 * k) for k in range(12)])
    np.testing.assert_allclose(found.range_mm[good], expected[good], atol=1.0)
    assert Flag(int(found.flags[5])) == Flag.NO_ECHO


def test_misuse_is_refused(receiver: Receiver, calibrated: Calibration) -> None:
    reference, echo = windows(receiver, 45.0, 4, 1)
    with pytest.raises(BadInput, match="4 reference windows and 2 echo windows"):
        estimate_windows(reference, echo.part(slice(0, 2)), calibration=calibrated)
    with pytest.raises(BadInput, match="M >= 12"):
        WindowTraces.of(np.zeros((3, 5)), 0.0, 6.7)
    with pytest.raises(BadInput, match="first_ps and sweeps"):
        WindowTraces.of(np.zeros((3, 50)), [1.0, 2.0], 6.7)
    with pytest.raises(BadInput, match="at least 1"):
        WindowTraces.of(np.zeros((3, 50)), 1.0, 6.7, 0)


class Scene:
    """A surface with a step, a hole without echo, and a bump, seen line by line by windows."""

    rows, columns = 25, 30

    def __init__(self, receiver: Receiver) -> None:
        self.receiver = receiver
        row, column = np.mgrid[0 : self.rows, 0 : self.columns]
        self.interval_ps = 3800.0 + 12.0 * row + 8.0 * column + 300.0 * ((row > 11) & (column > 15))
        self.hole = (np.abs(row - 18) < 2) & (np.abs(column - 6) < 2)
        self.response_mv = np.where(self.hole, 0.0, 32.0 + 0.8 * column)

    def look(self, row: int, column: int, point: PointWindows) -> tuple[np.ndarray, np.ndarray]:
        out = []
        for k, window in enumerate((point.reference, point.echo)):
            times = window.start_ps + window.step_ps * np.arange(window.samples)
            response = max(float(self.response_mv[row, column]), 1e-9)
            seed = 1000 * row + 10 * column + 2 * point.wide + k
            values = self.receiver.traces(
                times, self.interval_ps[row, column], response, records=1, seed=seed, sweeps=window.sweeps
            )
            out.append(values[0])
        return out[0], out[1]


def scan(scene: Scene, planner: WindowPlanner, calibration: Calibration) -> tuple[list[Ranges], int, int]:
    """Take all lines as the instrument would; also return shots and points taken again."""
    lines, shots, retaken = [], 0, 0
    settle = planner.settings.settle_shots
    shared = planner.settings.shared_reference
    for row in range(scene.rows):
        points = planner.line()
        traces = [scene.look(row, column, point) for column, point in enumerate(points)]
        ranges = estimate_points(points, traces, calibration=calibration, shared_reference=shared)
        shots += sum(point.shots(settle) for point in points)
        columns = planner.lost(points, ranges)
        if len(columns):
            again = planner.wide(columns)
            traces = [scene.look(row, int(column), point) for column, point in zip(columns, again, strict=True)]
            ranges = with_retaken(ranges, columns, estimate_points(again, traces, calibration=calibration))
            shots += sum(point.shots(settle) for point in again)
            retaken += len(columns)
        planner.learn(ranges)
        lines.append(ranges)
    return lines, shots, retaken


def test_a_planned_scan_loses_no_point_and_keeps_its_promise(receiver: Receiver, calibrated: Calibration) -> None:
    scene = Scene(receiver)
    planner = WindowPlanner(calibrated, scene.columns, PlanSettings(wanted_sd_mm=0.2, nearest_mm=480, farthest_mm=750))
    lines, shots, retaken = scan(scene, planner, calibrated)
    ranges = np.stack([line.range_mm for line in lines])
    flags = np.stack([line.flags for line in lines])
    np.testing.assert_array_equal(np.isnan(ranges), scene.hole)
    error = (ranges - np.vectorize(receiver.range_mm)(scene.interval_ps))[~scene.hole]
    assert np.sqrt(np.mean(error**2)) < 0.2
    assert np.abs(error).max() < 1.0
    assert shots / ranges.size < 190
    assert 0 < retaken < 0.1 * ranges.size
    assert (((flags & Flag.RETAKEN) != 0).sum()) == retaken
    variance = np.stack([line.variance_mm2 for line in lines])[~scene.hole]
    assert np.mean(error**2 / variance) == pytest.approx(1.0, abs=0.25)


def test_a_spot_on_a_rim_is_taken_again_and_marked_as_mixed(receiver: Receiver, calibrated: Calibration) -> None:
    columns, rim = 9, 4
    planner = WindowPlanner(calibrated, columns)

    def look(line: int, column: int, point: PointWindows) -> tuple[np.ndarray, np.ndarray]:
        traces = []
        for k, window in enumerate((point.reference, point.echo)):
            times = window.start_ps + window.step_ps * np.arange(window.samples)
            near_mv = 25.0 if column == rim and line == 1 else 45.0
            seed = 100 * column + 10 * point.wide + k
            trace = receiver.traces(times, 4500.0, near_mv, records=1, seed=seed, sweeps=window.sweeps)[0]
            if column == rim and line == 1:
                trace += receiver.pulse(times - receiver.reference_ps - 5900.0, 20.0)
            traces.append(trace)
        return traces[0], traces[1]

    for line in range(2):
        points = planner.line()
        found = estimate_points(points, [look(line, c, p) for c, p in enumerate(points)], calibration=calibrated)
        again = planner.lost(points, found)
        planner.learn(found)
    assert not any(point.wide for point in points)
    assert again.tolist() == [rim]
    wide = planner.wide(again)
    second = estimate_points(wide, [look(1, rim, wide[0])], calibration=calibrated)
    merged = with_retaken(found, again, second)
    assert Flag(int(merged.flags[rim])) == Flag.MIXED | Flag.RETAKEN
    assert not np.delete(merged.flags, rim).any()


def test_windows_get_cheaper_with_less_wanted_and_more_response(calibrated: Calibration) -> None:
    def shots(wanted_mm: float, response_mv: float) -> int:
        planner = WindowPlanner(calibrated, 20, PlanSettings(wanted_sd_mm=wanted_mm, first_response_mv=response_mv))
        return sum(point.shots(16) for point in planner.line())

    assert shots(0.15, 40.0) > shots(0.3, 40.0)
    assert shots(0.2, 20.0) > shots(0.2, 50.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"wanted_sd_mm": 0.0}, "planned for 0 mm"),
        ({"nearest_mm": 1200.0}, "the range rise"),
        ({"steps_ps": ()}, "at least one step"),
        ({"sweeps": (0, 1)}, "sweeps of 1 or more"),
        ({"steps_ps": (6.7, 80.0)}, "80 ps is too coarse"),
    ],
)
def test_a_plan_that_makes_no_sense_is_refused(change: dict[str, Any], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        PlanSettings(**change)


def test_a_line_of_another_length_is_refused(calibrated: Calibration) -> None:
    planner, other = WindowPlanner(calibrated, 4), WindowPlanner(calibrated, 3)
    points = other.line()
    flat = [(np.zeros(p.reference.samples), np.zeros(p.echo.samples)) for p in points]
    with pytest.raises(BadInput, match="3 points for a raster of 4 columns"):
        planner.learn(estimate_points(points, flat, calibration=calibrated))


def test_fixed_windows_are_all_alike(calibrated: Calibration) -> None:
    planner = WindowPlanner(calibrated, 6, PlanSettings(steps_ps=(6.7,), sweeps=(2,)))
    assert {(w.step_ps, w.sweeps) for point in planner.line() for w in (point.reference, point.echo)} == {(6.7, 2)}


def test_the_first_line_is_wide_and_the_next_ones_are_not(receiver: Receiver, calibrated: Calibration) -> None:
    planner = WindowPlanner(calibrated, 4)
    first = planner.line()
    assert all(point.wide for point in first)
    near = receiver.reference_ps + receiver.half_ps(45.0) + 620 / 0.14986
    assert first[0].echo.start_ps < near - 100
    assert first[0].echo.end_ps > near + (1200 - 620) / 0.14986 + 200
    found = estimate_points(
        first,
        [
            tuple(
                receiver.traces(w.start_ps + w.step_ps * np.arange(w.samples), 5000.0, 40.0, records=1, seed=3)[0]
                for w in (point.reference, point.echo)
            )
            for point in first
        ],
        calibration=calibrated,
    )
    planner.learn(found)
    for point in planner.line():
        assert not point.wide
        assert point.echo.start_ps + 150 < np.median(found.echo_ps) < point.echo.end_ps - 150


def test_the_promise_is_the_variance_of_the_estimator(receiver: Receiver, calibrated: Calibration) -> None:
    reference, echo = windows(receiver, 45.0, 200, 5)
    found = estimate_windows(reference, echo, calibration=calibrated)
    forms = [Window(float(w.first_ps[0]), 6.7, 96, 1) for w in (reference, echo)]
    rooms = tuple(
        float(np.median(point) - w.start_ps)
        for point, w in zip((found.reference_ps, found.echo_ps), forms, strict=True)
    )
    promised = promised_sd_mm(calibrated, forms[:1], forms[1:], response_mv=45.0, room_ps=(rooms[0], rooms[1]))
    assert promised[0, 0] == pytest.approx(np.sqrt(found.variance_mm2.mean()), rel=0.03)


def test_the_planner_needs_the_place_of_the_reference(calibrated: Calibration) -> None:
    with pytest.raises(BadInput, match="reference_ps"):
        WindowPlanner(calibrated.model_copy(update={"reference_ps": None}), 4)
    planner = WindowPlanner(calibrated, 4)
    reference = planner.line()[0].reference
    assert calibrated.reference_ps is not None
    assert reference.start_ps < calibrated.reference_ps[0] - 150
    assert reference.end_ps > calibrated.reference_ps[1] + 200


def test_weak_echoes_of_a_rim_do_not_make_the_search_beside_it_long(calibrated: Calibration) -> None:
    planner = WindowPlanner(calibrated, 40)
    usual = sum(point.shots(16) for point in planner.line())
    seen = np.full(40, np.nan)
    seen[18:22] = 9.0  # mV; nothing else has been met yet
    planner.load_state({**planner.state_dict(), "response_mv": seen.tolist()})
    beside = [point.shots(16) for column, point in enumerate(planner.line()) if not 18 <= column < 22]
    assert sum(beside) <= usual * len(beside) / 40 * 1.01
