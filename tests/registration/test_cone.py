"""A cone of directions narrows the search: poses outside it are neither sought nor reported."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.se3 import pose, rotation_from_vector, transform
from picoradar.registration.search import ANYWHERE, Cone
from picoradar.registration.search.cone import rotations_within

UP = [0.0, 0.0, 1.0]


@pytest.mark.parametrize("start", [{"towards": UP, "half_angle_deg": 20}, Cone(np.array(UP), 20.0)])
def test_a_scan_is_found_within_its_cone(socket: registration.Model, scan_of: Callable[..., Any], start: Any) -> None:
    scan = scan_of(socket, 4)
    found = registration.register(scan.points, socket, start=start, grid=scan.grid, range_bias_mm=0.1)
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 0.5
    assert error.translation_mm < 0.2
    assert found.verdict == "pass"


def test_a_cone_that_no_hollow_opens_to_gives_no_pose_to_use(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    """The back of the cup can be seen from there, so it is searched."""
    cone = {"towards": [0, 0, -1], "half_angle_deg": 40}
    verdict = "refused"
    with contextlib.suppress(registration.StartError):
        verdict = registration.register(scan_of(socket, 4).points, socket, start=cone, range_bias_mm=0.1).verdict
    assert verdict in ("refused", "fail")


@pytest.mark.parametrize("seed", range(4))
def test_a_cone_that_the_scan_did_not_come_from_gives_no_pose_to_use(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    """The hollow can be seen from there, but these points cannot: a refusal, or a minimum that the verdict rejects."""
    scan = scan_of(socket, seed)
    verdict = "refused"
    with contextlib.suppress(registration.StartError):
        verdict = registration.register(
            scan.points, socket, start={"towards": [1, 0, 1.2], "half_angle_deg": 6}, range_bias_mm=0.1
        ).verdict
    assert verdict in ("refused", "fail")


def wedge() -> registration.Model:
    """A roof of 1 : 2 with ends, closed below: it looks the same from the front and turned by half a turn."""
    x, y, z = 20.0, 20.0, 20.0
    v = np.array([[-x, -y, 0], [x, -y, 0], [0, -y, z], [-x, y, 0], [x, y, 0], [0, y, z]])
    f = [[0, 2, 1], [3, 4, 5], [0, 3, 5], [0, 5, 2], [1, 2, 5], [1, 5, 4], [0, 1, 4], [0, 4, 3]]
    return registration.prepare_model(v, np.array(f)[:, ::-1] if registration_volume(v, f) < 0 else np.array(f))


def registration_volume(v: np.ndarray, f: list[list[int]]) -> float:
    a, b, c = (v[np.array(f)[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))


def seen_obliquely() -> tuple[np.ndarray, registration.Model, np.ndarray]:
    """Points (N, 3) on the roof, seen along its ridge at an angle; the model, and the true pose."""
    model = wedge()
    facing = rotation_from_vector(np.array([0.5, 0.0, 0.0])) @ np.diag([1.0, -1.0, -1.0])
    truth = pose(facing, np.array([0.0, 0.0, 0.0]) - 900.0 * facing[:, 2])
    steps = np.arange(-25.0, 26.0, 1.0) / 900.0
    gx, gy = np.meshgrid(steps, steps)
    beams = np.stack([gx.ravel(), gy.ravel(), np.ones(gx.size)], axis=1)
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    origins = np.broadcast_to(truth[:3, 3], beams.shape)
    distance = model.surface.first_hit(origins, beams @ truth[:3, :3].T)
    hit = np.isfinite(distance)
    points = beams[hit] * (distance[hit] + np.random.default_rng(1).normal(0.0, 0.3, int(hit.sum())))[:, None]
    return points, model, truth


def test_a_cone_excludes_the_mirror_image_of_a_symmetric_body() -> None:
    """Seen obliquely along its ridge, a roof explains the points from either end; the cone knows which one."""
    points, model, truth = seen_obliquely()
    towards = transform(truth, np.zeros((1, 3)))[0]
    half_turn = pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    for expected in (truth, half_turn @ truth):
        axis = expected[:3, :3] @ truth[:3, :3].T @ towards
        found = registration.register(points, model, start={"towards": axis, "half_angle_deg": 15}, range_bias_mm=0.1)
        error = registration.pose_error(found.model_from_scanner, expected, np.zeros(3))
        assert error.rotation_deg < 0.5
        assert error.translation_mm < 0.3
        assert all(rival.rotation_deg < 90.0 for rival in found.rivals), "the half turn lies outside the cone"


def test_the_symmetry_equivalent_pose_is_reported_where_no_cone_excludes_it() -> None:
    """What the last test shows to be excluded is there without a cone."""
    points, model, _ = seen_obliquely()
    found = registration.register(points, model, range_bias_mm=0.1)
    assert found.rivals[0].rotation_deg == pytest.approx(180.0, abs=1.0)
    assert found.verdict != "pass"


def test_a_cone_is_made_a_unit_vector_and_checked() -> None:
    cone = Cone([0.0, 0.0, 10.0], 20)  # type: ignore[arg-type]
    np.testing.assert_array_equal(cone.towards, UP)
    for length in (1e-200, 1e200):
        np.testing.assert_array_equal(Cone(np.array([0.0, 0.0, length]), 20.0).towards, UP)
    for towards, half in (([0, 0, 1], np.nan), ([0, 0, 1], -5.0), ([0, 0, 1], 400.0), ([[0, 1]], 20.0)):
        with pytest.raises(registration.StartError):
            Cone(np.array(towards, dtype=float), half)


def test_rotations_lie_in_all_cones() -> None:
    towards = np.array([0.6, 0.0, 0.8])
    one, other = Cone(np.array([0.0, 0.0, 1.0]), 35.0), Cone(np.array([0.0, 0.6, 0.8]), 12.0)
    directions = rotations_within((one, other, ANYWHERE), towards, 500) @ towards
    assert len(directions) > 100
    assert one.holds(directions).all()
    assert other.holds(directions).all()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"towards": UP}, "half_angle_deg"),
        ({"towards": [0, 0], "half_angle_deg": 10}, "towards"),
        ({"towards": [0, 0, 0], "half_angle_deg": 10}, "no direction"),
        ({"towards": [0, float("nan"), 1], "half_angle_deg": 10}, "no direction"),
        ({"towards": UP, "half_angle_deg": 0}, "half angle"),
        ({"towards": UP, "half_angle_deg": 181}, "half angle"),
    ],
)
def test_a_cone_that_is_none_is_refused(socket: registration.Model, given: dict[str, Any], said: str) -> None:
    points = np.random.default_rng(0).normal(0.0, 20.0, (100, 3)) + [0.0, 0.0, 900.0]
    with pytest.raises(registration.StartError, match=said):
        registration.register(points, socket, start=given, range_bias_mm=0.1)


def test_the_dissertations_method_needs_a_pose(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    with pytest.raises(registration.StartError, match="needs a start"):
        registration.register(
            scan_of(socket, 0, n=12).points,
            socket,
            method="dissertation",
            start={"towards": UP, "half_angle_deg": 20},
            range_bias_mm=0.1,
        )
