"""The schedule of a search: how many rounds, where it looks closer, and what a start needs, by scripted descents."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.model import Place, View
from picoradar.registration.robust.schedule import worth_a_fit
from picoradar.registration.scan import checked_scan
from picoradar.registration.se3 import inverse, pose, rotation_angle_deg, rotation_from_vector, transform
from picoradar.registration.search import Candidate, Search
from picoradar.registration.search.successive_halving import stratified_order, survivors
from picoradar.registration.settings import RobustSettings, Stage

SETTINGS = RobustSettings()
STAGES, PATIENT_STAGES = SETTINGS.search.stages, SETTINGS.search.patient_stages
NEAR_STAGES = SETTINGS.search.near_stages
NATS = 1500.0
"""Points of the scan that minima are compared on, about: the scan is thinned to them."""


@dataclass(frozen=True)
class Descended:
    """One descent: how many starts, on which stages, how far they turn from the first of them, about which centre."""

    starts: int
    stages: tuple[Stage, ...]
    spread_deg: float
    shifts: int
    centre: np.ndarray


@dataclass
class Scripted:
    """Stands for the descent: every call finds what the script says, and is written down."""

    script: Callable[[int, View], list[Candidate]]
    thin: range  # its length alone is asked for
    calls: list[Descended] = field(default_factory=list)

    def from_starts(self, view: View, centre: Any, order: Any, rotations: Any, shifts: Any, stages: Any) -> Any:
        spread = max(rotation_angle_deg(one @ rotations[0].T) for one in rotations)
        self.calls.append(Descended(len(rotations), stages, spread, len(np.unique(shifts @ np.ones(3))), centre))
        return self.script(len(self.calls), view)

    def rated(self, view: View, given: np.ndarray) -> Candidate:
        return Candidate(given, -1.0, 0, view)


def turned(deg: float, nats: float, hits: int, view: View) -> Candidate:
    """A minimum so far from the first one, with so much of a likelihood in all."""
    rotation = rotation_from_vector(np.array([0.0, 0.0, np.radians(deg)]))
    return Candidate(pose(rotation, np.zeros(3)), nats / NATS, hits, view)


@pytest.fixture
def searching(socket: registration.Model, scan_of: Callable[..., Any]) -> Callable[..., tuple[Search, Scripted]]:
    def made(script: Callable[[int, View], list[Candidate]]) -> tuple[Search, Scripted]:
        search = Search(checked_scan(scan_of(socket, 4).points), socket, 0.35, SETTINGS)
        scripted = Scripted(script, range(int(NATS)))
        search.descent = scripted  # type: ignore[assignment]
        return search, scripted

    return made


def rounds_of(calls: list[Descended]) -> list[tuple[Stage, ...]]:
    return [call.stages for call in calls if call.stages != NEAR_STAGES]


def test_a_clear_minimum_that_many_survivors_reach_ends_the_search_at_once(searching: Any) -> None:
    search, scripted = searching(lambda _, view: [turned(0, 100, 4, view), turned(40, 59, 1, view)])
    assert len(search.from_anywhere()) == 2
    assert [call.stages for call in scripted.calls] == [STAGES]
    assert scripted.calls[0].starts == 256


def test_a_clear_minimum_of_three_survivors_gets_a_narrow_look(searching: Any) -> None:
    search, scripted = searching(lambda _, view: [turned(0, 100, 3, view), turned(40, 59, 1, view)])
    search.from_anywhere()
    assert [call.stages for call in scripted.calls] == [STAGES, NEAR_STAGES]
    assert scripted.calls[1].starts == 32
    assert 5.0 < scripted.calls[1].spread_deg <= 8.0


def test_an_unclear_minimum_that_wins_two_rounds_is_trusted_after_a_wide_look(searching: Any) -> None:
    """One hit each, 39 nats apart: found again in the second round, it gains the hits of one that is trusted."""
    search, scripted = searching(lambda _, view: [turned(0, 100, 1, view), turned(40, 61, 1, view)])
    found = search.from_anywhere()
    assert [call.stages for call in scripted.calls] == [STAGES, NEAR_STAGES] * 2
    assert scripted.calls[1].starts == 128
    assert 20.0 < scripted.calls[1].spread_deg <= 30.0
    assert search.confident(found)


def test_minima_that_no_round_finds_again_are_looked_for_in_four_rounds_the_last_two_patient(searching: Any) -> None:
    search, scripted = searching(lambda k, view: [turned(17 * k, 100, 1, view), turned(17 * k + 9, 99, 1, view)])
    found = search.from_anywhere()
    assert rounds_of(scripted.calls) == [STAGES, STAGES, PATIENT_STAGES, PATIENT_STAGES]
    assert not search.confident(found)


def test_from_the_second_round_on_other_spheres_are_tried(searching: Any) -> None:
    """Two centres of each of two further radii, for sockets are no true spheres."""
    search, scripted = searching(lambda k, view: [turned(17 * k, 100, 1, view), turned(17 * k + 9, 99, 1, view)])
    asked: list[tuple[float, int | None]] = []

    def centres(radius_mm: float, count: int | None = None) -> list[np.ndarray]:
        asked.append((radius_mm / search.model.views[0].radius_mm, count))
        return [np.array([radius_mm, k, 900.0]) for k in range(count or 1)]

    search.starts.sphere_centres = centres
    search.from_anywhere()
    assert asked == [(1.0, None), (pytest.approx(0.96), 2), (pytest.approx(1.04), 2)]
    shifted = 256 - math.ceil(256 / 5)  # five centres take turns, and the first of them is where it is
    assert [call.shifts for call in scripted.calls if call.stages != NEAR_STAGES][:2] == [1, 1 + shifted]


@pytest.mark.parametrize(("off_mm", "sphere"), [(39.0, True), (41.0, False)])
def test_the_sphere_in_the_cloud_counts_when_a_start_is_not_farther_off(
    searching: Any, scan_of: Callable[..., Any], off_mm: float, *, sphere: bool
) -> None:
    search, scripted = searching(lambda _, view: [turned(0, 100, 4, view)])
    start = scan_of(search.model, 4).truth
    seen = transform(inverse(start), search.model.views[0].centre[None])[0]  # by the start, in the scanner's frame
    found = seen + np.array([0.0, off_mm, 0.0])
    search.starts.sphere_centres = lambda _: [found]
    search.about(start)
    np.testing.assert_allclose(scripted.calls[0].centre, found if sphere else seen, atol=1e-9)
    assert 20.0 < scripted.calls[0].spread_deg <= 25.0


@pytest.mark.parametrize(
    ("hits", "nats", "confident"), [(3, 1.0, True), (2, 39.0, False), (2, 41.0, True), (1, 41.0, True)]
)
def test_a_minimum_is_trusted_by_hits_or_by_its_lead(
    searching: Any, hits: int, nats: float, *, confident: bool
) -> None:
    search, _ = searching(lambda _, __: [])
    view = search.model.views[0]
    assert search.confident([turned(0, nats, hits, view), turned(40, 0, 1, view)]) == confident


@pytest.mark.parametrize(
    ("least", "most", "within", "stay"),
    [(1, 9, math.inf, 6), (1, 4, math.inf, 4), (1, 9, 0.25, 3), (5, 9, 0.25, 5), (5, 2, 0.25, 2)],
)
def test_of_a_stage_those_stay_that_are_near_the_best(least: int, most: int, within: float, stay: int) -> None:
    """Not fewer than so many, however far behind, nor more than so many, however near."""
    score = np.array([0.7, 0.1, 0.9, 0.3, 0.2, 0.5], dtype=np.float32)
    stage = Stage(100, fine=True, min_survivors=least, max_survivors=most, within=within, scales_mm=(1.0,))
    assert survivors(stage, score).tolist() == [1, 4, 3, 5, 0, 2][:stay]


def test_the_first_points_of_a_stage_hold_fixed_shares_of_what_tells_rotations_apart() -> None:
    """Of 102: 40 in hollows beyond the sphere, 50 on it, 10 of low tissue and 2 of high; of their ratios alone."""
    heights = np.repeat([1.1, 0.9, -1.1, -2.6], 300)
    up = np.array([0.0, 0.0, 1.0])
    order = stratified_order((26.0 + heights)[:, None] * up, np.zeros(3), 26.0, 0, SETTINGS.search)
    assert np.unique(heights[order[:102]], return_counts=True)[1].tolist() == [2, 10, 50, 40]


@pytest.mark.parametrize(("beyond_deg", "kept"), [(1.9, True), (2.1, False)])
def test_a_pose_may_lie_two_degrees_outside_the_cone(
    socket: registration.Model, scan_of: Callable[..., Any], beyond_deg: float, *, kept: bool
) -> None:
    scan = checked_scan(scan_of(socket, 4).points)
    search = Search(scan, socket, 0.35, SETTINGS, registration.Cone(np.array([0.0, 0.0, 1.0]), 20.0))
    towards = search.starts.towards
    upright = rotation_from_vector(np.arccos(towards[2]) * np.cross(towards, [0, 0, 1]) / np.hypot(*towards[:2]))
    tilt = rotation_from_vector(np.array([np.radians(20.0 + beyond_deg), 0.0, 0.0]))
    one = Candidate(pose(tilt @ upright, np.zeros(3)), 0.0, 1, socket.views[0])
    assert bool(search.joined([], [one])) == kept


@pytest.mark.parametrize(("share", "served"), [(0.62, True), (0.58, False)])
def test_the_prepared_view_serves_a_start_that_brings_most_points_into_it(
    socket: registration.Model, scan_of: Callable[..., Any], share: float, *, served: bool
) -> None:
    """Else one is made: beside the socket there is other bone."""
    seen = scan_of(socket, 4)
    aside = np.arange(len(seen.points)) >= share * len(seen.points)
    points = seen.points + np.where(aside[:, None], 80.0 * seen.truth[0, :3], 0.0)  # along x of the model
    search = Search(checked_scan(points), socket, 0.35, SETTINGS)
    view = search.starts.view_at(seen.truth)
    assert (view is socket.views[0]) == served


@pytest.mark.parametrize(("step_mm", "prepared"), [(1.5, True), (1.6, False)])
def test_a_start_on_a_whole_model_gets_a_fine_view_that_reaches_beyond_the_points(
    searching: Any, step_mm: float, *, prepared: bool
) -> None:
    search, _ = searching(lambda _, __: [])
    whole = SimpleNamespace(whole=True, fine=SimpleNamespace(step_mm=step_mm), covers=lambda _: 1.0)
    search.starts.model = SimpleNamespace(views=(whole,), settings=search.model.settings, view_of=lambda place: place)
    found = search.starts.view_at(np.eye(4))
    assert (found is whole) == prepared
    if not prepared:
        towards = -search.scan.points.mean(axis=0)
        reach = np.linalg.norm(search.scan.points + towards, axis=1).max() + 15.0
        place = Place.of(-towards, towards / np.linalg.norm(towards), reach, search.model.settings.view)
        assert found == place


def test_candidates_near_the_best_are_fitted_and_the_one_most_starts_ended_at(searching: Any) -> None:
    """Three at most, within 60 nats, beside the one with the most hits."""
    search, _ = searching(lambda _, __: [])
    view = search.model.views[0]
    near = [turned(9 * k, 100 - 10 * k, 1, view) for k in range(4)]
    far, met = turned(50, 41, 1, view), turned(60, 10, 7, view)

    def chosen(candidates: list[Candidate]) -> list[Candidate]:
        fitted, others = worth_a_fit(candidates, int(NATS), SETTINGS)
        assert len(fitted) + len(others) == len(candidates)
        return fitted

    assert chosen([*near, met]) == [*near[:3], met]
    assert chosen([near[0], far, met]) == [near[0], far, met]
    assert chosen([near[0], turned(50, 39, 1, view), met]) == [near[0], met]
