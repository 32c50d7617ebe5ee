"""Live registration: when a pose is looked for, how it is followed, given up and confirmed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from picoradar.registration import Model, PointsError, Registration, RegistrationError, pose_error, register
from picoradar.registration.live import Line, LiveRegistration, tre_mm
from picoradar.registration.register.live.tracking import Tracker
from picoradar.registration.scan import checked_scan
from picoradar.registration.se3 import (
    inverse,
    pose,
    rotation_from_vector,
    small_motion,
    transform,
    vector_from_rotation,
)
from picoradar.registration.settings import LiveSettings, RobustSettings
from picoradar.registration.solution import Rival

CENTRE = [0.0, 0.0, 0.0]
TARGETS = [{"name": "centre", "position": CENTRE}]


def lines_of(points: np.ndarray, grid: np.ndarray, rows: Sequence[int] | None = None, **more: Any) -> Iterator[Line]:
    """Lines of a raster, in order of their rows or as given."""
    for row in np.unique(grid[:, 0]) if rows is None else rows:
        on = grid[:, 0] == row
        extra = {name: values[on] for name, values in more.items()}
        yield Line(int(row), grid[on, 1], points[on], **extra)


def distance_sd(one: Registration | None, other: Registration) -> float:
    """Distance of two poses in standard deviations of the second."""
    assert one is not None
    motion = one.model_from_scanner @ inverse(other.model_from_scanner)
    shift = transform(motion, other.centre[None])[0] - other.centre
    x = np.concatenate([vector_from_rotation(motion[:3, :3]), shift])
    return float(np.sqrt(x @ np.linalg.solve(other.covariance, x)))


def test_no_search_is_made_before_the_points_can_hold_a_pose(socket: Model) -> None:
    live = LiveRegistration(socket)
    assert (
        live.add(Line(0, np.arange(40), np.column_stack([np.arange(40.0), np.zeros(40), np.full(40, 900.0)]))) is None
    )
    assert live.result.why.startswith("40 points")
    for row in (1, 2, 3):  # a narrow strip
        live.add(
            Line(row, np.arange(40), np.column_stack([np.arange(40.0), np.full(40, 1.0 * row), np.full(40, 900.0)]))
        )
    assert "of a line" in live.result.why
    for row in range(4, 40):  # a plate
        live.add(
            Line(row, np.arange(40), np.column_stack([np.arange(40.0), np.full(40, 1.0 * row), np.full(40, 900.0)]))
        )
    assert "of a plane" in live.result.why
    assert live.result.searches == 0
    assert (live.result.stage, live.result.points, len(live.result.lines)) == ("waiting", 1600, 40)
    assert not live.reaches(None)


def test_a_pose_stands_after_a_few_lines_and_the_last_one_is_that_of_the_batch(
    socket: Model, scan_of: Callable[..., Any]
) -> None:
    scan = scan_of(socket, seed=3)
    live = LiveRegistration(socket, targets=TARGETS, range_bias_mm=0.1)
    stages, errors, predicted = [], [], []
    for line in lines_of(scan.points, scan.grid):
        found = live.add(line)
        stages.append(live.result.stage)
        if found is not None:
            errors.append(pose_error(found.model_from_scanner, scan.truth, np.zeros(3)).translation_mm)
            predicted.append(found.targets[0].rms_mm)
    first = stages.index("searched")
    assert first < 14
    assert set(stages[:first]) == {"waiting"}
    assert set(stages[first + 1 :]) == {"followed"}
    assert live.result.searches == 1
    assert predicted[-1] < 0.5 * predicted[0]
    assert np.sqrt(np.mean(np.square(np.array(errors) / predicted))) < 2.0
    last = live.result.registration
    batch = register(scan.points, socket, grid=scan.grid, targets=TARGETS, range_bias_mm=0.1)
    assert distance_sd(last, batch) < 1.0
    assert last is not None
    assert last.covariance == pytest.approx(batch.covariance, rel=0.5, abs=0.3 * float(np.abs(batch.covariance).max()))
    confirmed = live.confirm()
    assert (confirmed.stage, confirmed.verdict) == ("confirmed", "pass")
    assert distance_sd(confirmed.registration, batch) < 0.1


def test_a_result_is_a_value_that_later_lines_do_not_change(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=4)
    live = LiveRegistration(socket)
    kept = [(live.add(line), live.result)[1] for line in lines_of(scan.points, scan.grid)]
    assert [len(result.lines) for result in kept] == list(range(1, len(kept) + 1))
    assert [result.points for result in kept] == sorted(result.points for result in kept)
    with pytest.raises(dataclasses.FrozenInstanceError):
        kept[0].points = 3  # type: ignore[misc]


@given(st.randoms(use_true_random=False), st.integers(0, 200))
@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_the_order_of_the_lines_and_wherever_echoes_lack_it_ends_at_the_batch_pose(
    socket: Model, scan_of: Callable[..., Any], random: Any, lost: int
) -> None:
    scan = scan_of(socket, seed=5)
    rows = [int(row) for row in np.unique(scan.grid[:, 0])]
    random.shuffle(rows)
    points = scan.points.copy()
    points[np.random.default_rng(lost).permutation(len(points))[:lost]] = np.nan
    live = LiveRegistration(socket, targets=TARGETS)
    for line in lines_of(points, scan.grid, rows):
        live.add(line)
    there = np.isfinite(points).all(axis=1)
    assert live.result.points == there.sum()
    batch = register(points[there], socket, grid=scan.grid[there], targets=TARGETS)
    assert distance_sd(live.result.registration, batch) < 3.0
    assert distance_sd(live.confirm().registration, batch) < 0.1


def test_the_same_lines_lead_to_the_same_bits(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=6)

    def poses() -> list[bytes]:
        live = LiveRegistration(socket, range_bias_mm=0.1)
        found = [live.add(line) for line in lines_of(scan.points, scan.grid)]
        return [b"" if one is None else one.model_from_scanner.tobytes() + one.covariance.tobytes() for one in found]

    assert poses() == poses()


def test_a_patient_who_moved_is_found_again(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=7)
    moved = pose(rotation_from_vector(np.array([0.05, -0.08, 0.2])), np.array([6.0, -4.0, 5.0]))
    centre = np.asarray(scan.points.mean(axis=0))
    points = scan.points.copy()
    after = scan.grid[:, 0] >= 12
    points[after] = transform(moved, points[after] - centre) + centre
    back = inverse(moved)
    truth = scan.truth @ pose(back[:3, :3], back[:3, 3] + centre - back[:3, :3] @ centre)
    live, whys = LiveRegistration(socket), {}
    for line in lines_of(points, scan.grid):
        live.add(line)
        whys[line.index] = live.result.why
        if line.index == 11:
            before = live.result
    assert any("last lines" in why for row, why in whys.items() if row < 20)  # soon, while most of the old points fit
    assert not any("last lines" in why for row, why in whys.items() if row < 12)
    assert before.searches == 1
    assert before.registration is not None
    assert pose_error(before.registration.model_from_scanner, scan.truth, np.zeros(3)).translation_mm < 0.5
    found = live.result.registration
    assert live.result.searches > 1
    assert found is not None
    assert pose_error(found.model_from_scanner, truth, np.zeros(3)).translation_mm < 0.5
    assert found.verdict != "pass"  # a part of the points lies where the bone was before


def test_the_goal_is_reached_only_by_a_verdict_that_is_steady_and_confirmed(
    socket: Model, scan_of: Callable[..., Any]
) -> None:
    scan = scan_of(socket, seed=8)

    def ends_at(until_tre_mm: float | None, steady: int, **options: Any) -> int | None:
        live = LiveRegistration(socket, live=LiveSettings(steady_lines=steady), targets=TARGETS, **options)
        for number, line in enumerate(lines_of(scan.points, scan.grid)):
            live.add(line)
            if live.reaches(until_tre_mm):
                assert live.result.stage == "confirmed"
                assert live.result.verdict == "pass"
                assert until_tre_mm is None or live.result.worst_tre_mm <= until_tre_mm
                return number
        return None

    sooner, later = ends_at(None, 1, range_bias_mm=0.1), ends_at(None, 6, range_bias_mm=0.1)
    assert sooner is not None
    assert later is not None
    assert later >= sooner + 4
    closer = ends_at(0.106, 1, range_bias_mm=0.1)  # hardly more than the common range error
    assert closer is not None
    assert closer > sooner
    assert ends_at(0.09, 1, range_bias_mm=0.1) is None  # less than it: no line makes it smaller
    assert ends_at(None, 1) is None  # never measured: a caution at best


def test_a_target_tells_of_the_common_range_error_too(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=9)
    target = register(scan.points, socket, grid=scan.grid, targets=TARGETS, range_bias_mm=0.3).targets[0]
    assert tre_mm(target) ** 2 == pytest.approx(target.rms_mm**2 + target.bias_mm**2)
    assert target.bias_mm > 0.2
    unknown = register(scan.points, socket, grid=scan.grid, targets=TARGETS).targets[0]
    assert tre_mm(unknown) == np.inf


def test_points_darker_than_bone_do_not_pull_the_followed_pose(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=10, noise_mm=0.2)
    film = (scan.grid[:, 1] > 12) & (scan.grid[:, 1] < 24)
    ranges = np.linalg.norm(scan.points, axis=1)
    points = scan.points * np.where(film, 1.0 - 0.5 / ranges, 1.0)[:, None]  # 0.5 mm of blood
    facing = -np.einsum(
        "ij,ij->i",
        socket.closest(transform(scan.truth, scan.points)).normals,
        scan.points / ranges[:, None] @ scan.truth[:3, :3].T,
    )
    response = 100.0 * (0.3 + 0.7 * np.clip(facing, 0.0, 1.0)) * np.where(film, 0.35, 1.0)
    covariance = np.broadcast_to(0.04 * np.eye(3), (len(points), 3, 3))

    def last(**more: Any) -> float:
        live = LiveRegistration(socket)
        for line in lines_of(points, scan.grid, covariance_mm2=covariance, **more):
            live.add(line)
        assert live.result.registration is not None
        return pose_error(live.result.registration.model_from_scanner, scan.truth, np.zeros(3)).translation_mm

    assert last(response_mv=response) < 0.5 * last()


def test_a_line_that_cannot_be_used_changes_nothing(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=11)
    lines = list(lines_of(scan.points, scan.grid))
    live = LiveRegistration(socket)
    for line in lines[:15]:
        live.add(line)
    before = live.result
    with pytest.raises(PointsError, match="added already"):
        live.add(lines[3])
    with pytest.raises(PointsError, match="line 99: points have shape"):
        live.add(Line(99, np.arange(3), np.zeros((4, 3))))
    with pytest.raises(PointsError, match="line 99: covariance has shape"):
        live.add(Line(99, np.arange(3), np.full((3, 3), 900.0), np.zeros((3, 2, 2))))
    with pytest.raises(PointsError, match="at the scanner's origin"):
        live.add(Line(99, np.arange(3), np.zeros((3, 3))))
    assert live.result is before
    live.add(lines[15])
    assert len(live.result.lines) == 16


def test_options_are_refused_before_the_first_line(socket: Model) -> None:
    with pytest.raises(RegistrationError, match="noise_mm"):
        LiveRegistration(socket, noise_mm=-1.0)
    with pytest.raises(RegistrationError, match="range_bias_mm"):
        LiveRegistration(socket, range_bias_mm=-1.0)
    with pytest.raises(RegistrationError, match="targets"):
        LiveRegistration(socket, targets=[[1.0, 2.0]])
    with pytest.raises(RegistrationError):
        LiveRegistration(socket, start="somewhere")
    with pytest.raises(PointsError, match="origin"):
        LiveRegistration(socket, origin=[1.0])


def test_lines_without_any_echo_change_nothing_but_the_count(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=12)
    live, plain = LiveRegistration(socket), LiveRegistration(socket)
    for line in lines_of(scan.points, scan.grid):
        live.add(line)
        live.add(Line(1000 + line.index, np.arange(40), np.full((40, 3), np.nan)))
        plain.add(line)
    assert len(live.result.lines) == 2 * len(plain.result.lines)
    for result in (live.result, plain.result):
        assert result.registration is not None
    assert live.result.points == plain.result.points
    assert live.result.searches == plain.result.searches
    np.testing.assert_array_equal(live.result.model_from_scanner, plain.result.model_from_scanner)


def test_rivals_are_watched_and_the_likelier_one_comes_to_light(socket: Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, seed=13)
    tracker = Tracker(socket, None, None, np.empty((0, 4)), RobustSettings(), LiveSettings())
    measured = checked_scan(scan.points, grid=scan.grid)
    right = tracker.searched(measured)
    centre = np.asarray(transform(right.model_from_scanner, scan.points).mean(axis=0))
    turn = small_motion(np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0]), centre)
    wrong = dataclasses.replace(right, model_from_scanner=turn @ right.model_from_scanner)
    believed = Rival(right.model_from_scanner, wrong.cost + 0.01, 34.0, 0.0)
    slid = Rival(turn @ right.model_from_scanner, right.cost + 0.01, 34.0, 0.0)
    hopeless = Rival(right.model_from_scanner, right.cost + 1.0, 34.0, 0.0)

    (seen,) = tracker.watched(measured, dataclasses.replace(wrong, rivals=[believed]), 0).rivals
    assert seen.cost < wrong.cost  # the pose that is followed is the rival's rival
    (seen,) = tracker.watched(measured, dataclasses.replace(right, rivals=[slid]), 0).rivals
    assert seen.cost > right.cost + 0.05
    assert seen.rotation_deg == pytest.approx(34.4, abs=3.0)
    assert tracker.watched(measured, dataclasses.replace(right, rivals=[hopeless]), 0).rivals == [hopeless]
    twin = Rival(small_motion(np.full(6, 1e-4), centre) @ right.model_from_scanner, right.cost + 0.01, 0.1, 0.1)
    assert tracker.watched(measured, dataclasses.replace(right, rivals=[twin]), 0).rivals == []
