"""Input that has no right pose is refused or fails in words; it never passes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh

from picoradar import registration
from picoradar.registration.se3 import frame_about, inverse, pose, transform
from picoradar.sim.physics import HIP_FILE, SOCKET_AXIS, SOCKET_CENTRE_MM


@pytest.fixture(scope="module")
def hip_in_socket_frame() -> tuple[np.ndarray, np.ndarray]:
    """The shipped hip bone with its socket's centre in the origin, opening along +z, where `scan_of` looks."""
    hip = trimesh.load(HIP_FILE)
    z = np.array(SOCKET_AXIS) / np.linalg.norm(SOCKET_AXIS)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    model_from_socket = pose(np.stack([x, np.cross(z, x), z], axis=1), np.array(SOCKET_CENTRE_MM))
    return transform(inverse(model_from_socket), np.asarray(hip.vertices)), np.asarray(hip.faces)


@pytest.fixture(scope="module")
def hip(hip_in_socket_frame: tuple[np.ndarray, np.ndarray]) -> registration.Model:
    return registration.prepare_model(*hip_in_socket_frame)


@pytest.fixture(scope="module")
def other_side(hip_in_socket_frame: tuple[np.ndarray, np.ndarray]) -> registration.Model:
    vertices, faces = hip_in_socket_frame
    return registration.prepare_model(vertices * [-1.0, 1.0, 1.0], faces[:, ::-1])


@pytest.mark.parametrize("seed", range(2))
def test_the_other_hip_never_passes(
    hip: registration.Model, other_side: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    scan = scan_of(hip, seed)
    assert registration.register(scan.points, hip, grid=scan.grid, range_bias_mm=0.1).verdict == "pass"
    for model, points in ((other_side, scan.points), (hip, scan_of(other_side, seed).points)):
        found = registration.register(points, model, range_bias_mm=0.1)
        assert found.verdict == "fail"
        assert found.reasons


@pytest.mark.parametrize("seed", range(3))
def test_a_shell_of_the_other_hip_never_passes(
    hip: registration.Model, other_side: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    """An open model has no inside that points could lie in; whole patches beside it tell."""
    corners = other_side.vertices[other_side.faces]
    inner = (corners[:, :, 2].max(axis=1) < -8.0) & (np.linalg.norm(corners.mean(axis=1), axis=1) < 31.0)
    shell = registration.prepare_model(other_side.vertices, other_side.faces[inner])
    assert registration.register(scan_of(hip, seed).points, shell, range_bias_mm=0.1).verdict != "pass"


@pytest.mark.parametrize("seed", range(4))
def test_a_box_that_turns_onto_itself_never_passes(seed: int) -> None:
    """From any side three other poses are exactly as good, whether the search reaches them or not."""
    box = trimesh.creation.box((40.0, 30.0, 20.0))
    model = registration.prepare_model(np.asarray(box.vertices), np.asarray(box.faces))
    rng = np.random.default_rng([seed, 8])
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    truth = pose(frame_about(-axis), 900.0 * axis)
    steps = np.linspace(-30.0, 30.0, 45) / 900.0
    gx, gy = np.meshgrid(steps, steps)
    beams = np.stack([gx.ravel(), gy.ravel(), np.ones(gx.size)], axis=1)
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    ranges = model.surface.first_hit(np.broadcast_to(truth[:3, 3], beams.shape), beams @ truth[:3, :3].T)
    hit = np.isfinite(ranges)
    points = beams[hit] * (ranges[hit] + rng.normal(0.0, 0.2, int(hit.sum())))[:, None]
    found = registration.register(points, model, range_bias_mm=0.1)
    assert found.verdict != "pass"
    assert sum(rival.rotation_deg == pytest.approx(180.0, abs=1.0) for rival in found.rivals) >= 1


def test_another_bone_never_passes_even_from_a_start(
    hip: registration.Model, socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    """Both sockets lie in the same place, so that the start is as good as it can be."""
    scan = scan_of(socket, 1)
    for start in ("any", scan.truth):
        assert registration.register(scan.points, hip, start=start, range_bias_mm=0.1).verdict == "fail"


@pytest.mark.parametrize(
    "body",
    [
        trimesh.creation.icosphere(subdivisions=4, radius=25.5),
        trimesh.creation.box((120.0, 120.0, 10.0)),
    ],
    ids=["ball", "board"],
)
def test_a_scan_of_something_else_fails(
    hip: registration.Model, scan_of: Callable[..., Any], body: trimesh.Trimesh
) -> None:
    scan = scan_of(registration.prepare_model(body.vertices, body.faces), 1)
    assert registration.register(scan.points, hip, range_bias_mm=0.1).verdict == "fail"


def test_too_few_points_to_tell_fail_or_are_refused(hip: registration.Model, scan_of: Callable[..., Any]) -> None:
    points = scan_of(hip, 1).points[::110]
    assert 6 < len(points) < 20
    assert registration.register(points, hip, range_bias_mm=0.1).verdict == "fail"
    with pytest.raises(registration.PointsError, match="six unknowns"):
        registration.register(points[:5], hip, range_bias_mm=0.1)


def test_a_model_in_metres_is_refused(hip_in_socket_frame: tuple[np.ndarray, np.ndarray]) -> None:
    vertices, faces = hip_in_socket_frame
    with pytest.raises(registration.MeshError, match="metres"):
        registration.prepare_model(vertices / 1000.0, faces)
