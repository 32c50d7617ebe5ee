"""From anywhere: more than one hollow that looks alike, and points that were taken away from all hollows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from picoradar import registration
from picoradar.registration.se3 import inverse, pose, rotation_angle_deg, transform
from tests.registration.conftest import SimulatedScan, socket_mesh

ScanOf = Callable[..., SimulatedScan]


def apart(found: np.ndarray, truth: np.ndarray, points: np.ndarray) -> tuple[float, float]:
    """Rotation (deg) between two poses, and how far they put the middle of the points apart (mm)."""
    middle = points.mean(axis=0)[None]
    turn = rotation_angle_deg(found[:3, :3] @ truth[:3, :3].T)
    return float(turn), float(np.linalg.norm(transform(found, middle) - transform(truth, middle)))


def side_by_side(moved: np.ndarray, *, mirrored: bool) -> registration.Model:
    vertices, faces = socket_mesh()
    other, turned = (vertices * [-1.0, 1.0, 1.0], faces[:, ::-1]) if mirrored else (vertices, faces)
    return registration.prepare_model(np.r_[vertices, other + moved], np.r_[faces, turned + len(vertices)])


@pytest.fixture(scope="module")
def twins() -> registration.Model:
    """The same bone twice, beside each other: no scan can tell which one it shows."""
    return side_by_side(np.array([150.0, 0.0, 0.0]), mirrored=False)


@pytest.fixture(scope="module")
def both_sides() -> registration.Model:
    """Two hips in one model, as a CT gives them."""
    return side_by_side(np.array([170.0, 5.0, 3.0]), mirrored=True)


@pytest.mark.parametrize("seed", range(2))
def test_twins_in_one_model_are_rivals(twins: registration.Model, scan_of: ScanOf, seed: int) -> None:
    scan = scan_of(twins, seed)
    found = registration.register(scan.points, twins, grid=scan.grid, range_bias_mm=0.1)
    assert found.verdict == "caution"
    turn_deg, shift_mm = found.rivals[0].rotation_deg, found.rivals[0].translation_mm
    assert turn_deg < 1.0
    assert shift_mm == pytest.approx(150.0, abs=0.5)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("side", [0.0, 1.0])
def test_the_right_one_of_two_hips_is_found(
    both_sides: registration.Model, scan_of: ScanOf, seed: int, side: float
) -> None:
    if side:
        aimed = registration.prepare_model(both_sides.vertices - [170.0, 5.0, 3.0], both_sides.faces)
        scan = scan_of(aimed, seed)
        truth = pose(np.eye(3), np.array([170.0, 5.0, 3.0])) @ scan.truth
    else:
        scan = scan_of(both_sides, seed)
        truth = scan.truth
    found = registration.register(scan.points, both_sides, grid=scan.grid, range_bias_mm=0.1)
    turn_deg, shift_mm = apart(found.model_from_scanner, truth, scan.points)
    assert turn_deg < 0.5
    assert shift_mm < 0.3


def lumpy() -> tuple[np.ndarray, np.ndarray]:
    """A cup on a lumpy body of 240 mm: most of it is nowhere near a hollow."""
    ball = trimesh.creation.icosphere(subdivisions=6, radius=1.0)
    direction = np.asarray(ball.vertices)
    waves = np.random.default_rng(8).normal(size=(40, 3)) * 4.0
    phase = np.random.default_rng(9).uniform(0, 2 * np.pi, 40)
    radius = 80.0 + 3.0 * np.sin(direction @ waves.T + phase).sum(axis=1)
    body = direction * radius[:, None] * [1.0, 1.3, 0.8] + [0.0, 0.0, -110.0]
    vertices, faces = socket_mesh()
    return np.r_[vertices, body], np.r_[faces, np.asarray(ball.faces) + len(vertices)]


def seen_from(model: registration.Model, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a patch of the body about a random place, taken along its normal; and the true pose."""
    rng = np.random.default_rng(seed)
    low = np.flatnonzero(model.vertices[model.faces].mean(axis=1)[:, 2] < -90.0)
    face = rng.choice(low)
    back = model.surface.face_normals[face]
    x = np.cross(rng.normal(size=3), -back)
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(-back, x), -back], axis=1)
    truth = pose(rotation, model.vertices[model.faces[face]].mean(axis=0) + 870.0 * back)
    steps = np.arange(-25.0, 26.0) * 1.4 / 870.0
    gx, gy = np.meshgrid(steps, steps)
    beams = np.stack([gx.ravel(), gy.ravel(), np.ones(gx.size)], axis=1)
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    reach = model.surface.first_hit(np.broadcast_to(truth[:3, 3], beams.shape), beams @ rotation.T)
    hit = np.isfinite(reach)
    return beams[hit] * (reach[hit] + rng.normal(0.0, 0.3, hit.sum()))[:, None], truth


@pytest.mark.parametrize("seed", range(3))
def test_points_away_from_every_hollow_are_found_on_the_body(seed: int) -> None:
    model = registration.prepare_model(*lumpy())
    assert any(view.is_socket for view in model.views)
    points, truth = seen_from(model, seed)
    found = registration.register(points, model, range_bias_mm=0.1)
    turn_deg, shift_mm = apart(found.model_from_scanner, truth, points)
    assert turn_deg < 1.0
    assert shift_mm < 0.5


def test_a_cone_holds_on_the_body_too() -> None:
    model = registration.prepare_model(*lumpy())
    points, truth = seen_from(model, 11)
    towards = -transform(truth, points.mean(axis=0)[None])[0] + truth[:3, 3]
    cone = {"towards": (-towards).tolist(), "half_angle_deg": 30.0}
    try:
        found = registration.register(points, model, start=cone, range_bias_mm=0.1)
    except registration.StartError:
        return
    looked = (inverse(found.model_from_scanner) @ np.r_[-towards / np.linalg.norm(towards), 0.0])[:3]
    assert found.verdict == "fail" or looked @ -points.mean(axis=0) > 0
