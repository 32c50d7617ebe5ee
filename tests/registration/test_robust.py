"""The robust method from any pose: success, invariances, honest verdicts, the same bits on every run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar import registration
from picoradar.registration.se3 import inverse, pose, rotation_angle_deg, rotation_from_vector, transform


def with_tissue(scan: Any, seed: int, share: float) -> np.ndarray:
    """Clumps of tissue, 1 to 9 mm high, in front of a share of the points."""
    rng = np.random.default_rng([seed, 5])
    points = scan.points
    beams = points / np.linalg.norm(points, axis=1, keepdims=True)
    height = np.zeros(len(points))
    while (height > 0).mean() < share:
        middle, width, top = points[rng.integers(len(points))], rng.uniform(3.0, 8.0), rng.uniform(2.0, 9.0)
        q = np.linalg.norm(points - middle, axis=1) / width
        height = np.maximum(height, np.where(q < 1, 1.0 + (top - 1.0) * np.clip(1 - q * q, 0, 1) ** 0.7, 0.0))
    return points - beams * height[:, None]


@pytest.mark.parametrize("seed", range(6))
def test_finds_the_pose_from_anywhere_under_tissue(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    scan = scan_of(socket, seed)
    found = registration.register(with_tissue(scan, seed, 0.4), socket, grid=scan.grid, range_bias_mm=0.1)
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 1.0
    assert error.translation_mm < 0.3
    assert error.rotation_deg < 4.0 * found.predicted_rotation_deg


@pytest.mark.parametrize("seed", range(2))
def test_a_socket_that_is_no_sphere_is_found(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    oval = registration.prepare_model(socket.vertices * [1.06, 0.95, 1.02], socket.faces)
    scan = scan_of(oval, 20 + seed)
    found = registration.register(with_tissue(scan, seed, 0.4), oval, grid=scan.grid, range_bias_mm=0.1)
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 1.0
    assert error.translation_mm < 0.3


def test_steep_walls_bias_nothing(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    """Without tissue the errors keep to the information of the points: beams are cast, not drawn to closest points."""
    turns, predicted = [], []
    for seed in range(6):
        scan = scan_of(socket, 200 + seed, n=50)
        found = registration.register(
            scan.points, socket, start=scan.truth, grid=scan.grid, noise_mm=0.35, range_bias_mm=0.1
        )
        turns.append(registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3)).rotation_deg)
        predicted.append(found.predicted_rotation_deg)
    assert np.sqrt(np.mean(np.square(turns))) < 1.4 * np.mean(predicted)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cut_mm", [-7.0, -2.0])
def test_a_scan_that_reaches_beyond_a_cut_out_shell_is_found(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int, cut_mm: float
) -> None:
    """Beams that pass by the border say nothing about bone, on whichever side of it they end."""
    corners = socket.vertices[socket.faces]
    inner = (corners[:, :, 2].max(axis=1) < cut_mm) & (np.linalg.norm(corners.mean(axis=1), axis=1) < 31.0)
    shell = registration.prepare_model(socket.vertices, socket.faces[inner])
    scan = scan_of(socket, 40 + seed)
    found = registration.register(scan.points, shell, grid=scan.grid, range_bias_mm=0.1)
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 0.5
    assert error.translation_mm < 0.2
    assert 0.5 < found.inliers.mean() < 0.98
    assert found.verdict == "pass", found.reasons


@pytest.mark.parametrize("seed", range(2))
def test_a_real_bone_is_found_in_its_own_frame(shared_bone: Path, scan_of: Callable[..., Any], seed: int) -> None:
    model = registration.load_model(shared_bone)
    view = model.views[0]
    basis = np.linalg.svd(view.axis[None])[2].T[:, [1, 2, 0]]
    basis[:, 2] = view.axis
    basis[:, 0] = np.cross(basis[:, 1], basis[:, 2])
    model_from_local = pose(basis, view.centre)
    local = registration.prepare_model(transform(inverse(model_from_local), model.vertices), model.faces)
    scan = scan_of(local, seed, n=44)
    found = registration.register(with_tissue(scan, seed, 0.4), model, range_bias_mm=0.1)
    error = registration.pose_error(found.model_from_scanner, model_from_local @ scan.truth, view.centre)
    assert error.rotation_deg < 1.0
    assert error.translation_mm < 0.5


def test_the_same_input_gives_the_same_bits(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    points = with_tissue(scan_of(socket, 3), 3, 0.4)
    first, second = (registration.register(points, socket, range_bias_mm=0.1) for _ in range(2))
    assert first.model_from_scanner.tobytes() == second.model_from_scanner.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


@settings(deadline=None, max_examples=3)
@given(seed=st.integers(0, 1000), far=st.booleans())
def test_the_frames_do_not_matter(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int, far: bool
) -> None:
    """Turned scanner and model frames, also with 10 m between them and their origins, and shuffled points."""
    scan = scan_of(socket, 1, n=30)
    rng = np.random.default_rng(seed)
    offset = 1e4 if far else 100.0
    a = pose(rotation_from_vector(rng.normal(size=3)), rng.normal(size=3) * offset)
    b = pose(rotation_from_vector(rng.normal(size=3)), rng.normal(size=3) * offset)
    moved = registration.prepare_model(transform(a, socket.vertices), socket.faces)
    order = rng.permutation(len(scan.points))
    base = registration.register(scan.points, socket, start=scan.truth, range_bias_mm=0.1).model_from_scanner
    start = a @ scan.truth @ inverse(b)
    found = registration.register(
        transform(b, scan.points)[order], moved, start=start, origin=b[:3, 3], range_bias_mm=0.1
    )
    back = inverse(a) @ found.model_from_scanner @ b
    error = registration.pose_error(back, base, np.zeros(3))
    assert np.linalg.det(found.model_from_scanner[:3, :3]) == pytest.approx(1.0, abs=1e-12)
    assert error.rotation_deg < 0.02
    assert error.translation_mm < 0.01


def test_the_truth_is_a_fixed_point_without_noise(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 2, noise_mm=0.0)
    found = registration.register(scan.points, socket, start=scan.truth, range_bias_mm=0.1)
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 1e-3
    assert error.translation_mm < 1e-3
    assert found.rms_mm < 1e-3


def test_predicted_errors_are_honest(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    """Squared errors over predicted variances average about one."""
    ratio = []
    for seed in range(12):
        scan = scan_of(socket, 100 + seed)
        found = registration.register(
            scan.points, socket, start=scan.truth, targets=np.zeros((1, 3)), range_bias_mm=0.1
        )
        error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
        turn = error.rotation_deg / found.predicted_rotation_deg
        shift = error.translation_mm / found.targets[0].rms_mm
        ratio.append((turn**2, shift**2))
    mean = np.mean(ratio, axis=0)
    assert 0.3 < mean[0] < 2.0
    assert 0.3 < mean[1] < 2.0


def test_covariances_and_noise_are_taken_as_given(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 4)
    beams = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
    covariance = 0.35**2 * np.einsum("ni,nj->nij", beams, beams) + 0.02**2 * np.eye(3)
    found = registration.register(scan.points, socket, start=scan.truth, covariance=covariance, range_bias_mm=0.1)
    plain = registration.register(scan.points, socket, start=scan.truth, noise_mm=0.35, range_bias_mm=0.1)
    assert found.predicted_rotation_deg == pytest.approx(plain.predicted_rotation_deg, rel=0.1)
    assert plain.noise_mm == 0.35


def test_excluded_regions_take_no_part(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 5)
    region = {"center": [0.0, 0.0, -29.6], "radius_mm": 12.0}
    found = registration.register(scan.points, socket, start=scan.truth, exclude=[region], range_bias_mm=0.1)
    moved = transform(found.model_from_scanner, scan.points)
    in_region = np.linalg.norm(moved - region["center"], axis=1) < 11.5
    assert in_region.sum() > 50
    assert not found.inliers[in_region].any()
    assert found.inliers[~in_region].mean() > 0.9


@pytest.mark.parametrize("seed", range(2))
def test_a_mirrored_model_never_passes(socket: registration.Model, scan_of: Callable[..., Any], seed: int) -> None:
    mirrored = registration.prepare_model(socket.vertices * [-1.0, 1.0, 1.0], socket.faces[:, ::-1])
    found = registration.register(with_tissue(scan_of(socket, seed), seed, 0.3), mirrored, range_bias_mm=0.1)
    assert found.verdict != "pass"
    assert found.reasons


def hollow_sphere() -> registration.Model:
    u, v = np.meshgrid(np.linspace(0.02, np.pi / 2, 40), np.linspace(0, 2 * np.pi, 80, endpoint=False), indexing="ij")
    vertices = 26.0 * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), -np.cos(u)], axis=-1).reshape(-1, 3)
    a = (np.arange(39)[:, None] * 80 + np.arange(80)).ravel()
    b = (np.arange(39)[:, None] * 80 + (np.arange(80) + 1) % 80).ravel()
    faces = np.concatenate([np.stack([a, b, b + 80], 1), np.stack([a, b + 80, a + 80], 1)])
    return registration.prepare_model(vertices, faces)


def plane() -> registration.Model:
    corners = np.array([[-60.0, -60, 0], [60, -60, 0], [60, 60, 0], [-60, 60, 0]])
    return registration.prepare_model(corners, np.array([[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize("make", [hollow_sphere, plane])
@pytest.mark.parametrize("anywhere", [True, False])
def test_a_sphere_or_a_plane_leaves_the_pose_free(
    make: Callable[[], registration.Model], anywhere: bool, scan_of: Callable[..., Any]
) -> None:
    model = make()
    scan = scan_of(model, 1, n=30)
    keep = np.linalg.norm(transform(scan.truth, scan.points)[:, :2], axis=1) < 22.0
    found = registration.register(scan.points[keep], model, start="any" if anywhere else scan.truth, range_bias_mm=0.1)
    assert found.verdict == "fail"
    assert np.isfinite(found.model_from_scanner).all()
    assert found.predicted_rotation_deg > 1.0
    assert any("turning" in text or "sliding" in text for text in found.weak_directions)


def test_points_far_from_what_the_model_is_fail(socket: registration.Model) -> None:
    cloud = np.random.default_rng(0).normal(0.0, 20.0, (500, 3)) + [0.0, 0.0, 900.0]
    assert registration.register(cloud, socket, range_bias_mm=0.1).verdict == "fail"


def test_a_start_beside_the_model_is_refused(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 0, n=12)
    beside = scan.truth.copy()
    beside[:3, 3] += [500.0, 0.0, 0.0]
    with pytest.raises(registration.StartError, match="beside the model"):
        registration.register(scan.points, socket, start=beside, range_bias_mm=0.1)


def test_a_cloud_in_metres_is_refused(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    with pytest.raises(registration.PointsError, match="metres"):
        registration.register(scan_of(socket, 0, n=12).points / 1000.0, socket, range_bias_mm=0.1)


def prism() -> registration.Model:
    x, y = np.meshgrid(np.linspace(-20, 20, 41), np.linspace(-20, 20, 41), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 40.0 - 2.0 * np.abs(x).ravel()], axis=1)
    a = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    return registration.prepare_model(
        vertices, np.concatenate([np.stack([a, a + 41, a + 42], 1), np.stack([a, a + 42, a + 1], 1)])
    )


def test_a_prism_is_found_from_anywhere_but_for_its_symmetry() -> None:
    model = prism()
    facing = rotation_from_vector(np.array([0.1, -0.05, 0.3])) @ np.diag([1.0, -1.0, -1.0])
    truth = pose(facing, np.array([5.0, 3.0, 900.0]))
    points = transform(inverse(truth), model.vertices)
    points[:, 2] += np.random.default_rng(0).normal(0.0, 0.27, len(points))
    found = registration.register(points, model, range_bias_mm=0.1)
    half_turn = pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    moved = min(
        (found.model_from_scanner @ inverse(t) for t in (truth, half_turn @ truth)),
        key=lambda m: rotation_angle_deg(m[:3, :3]),
    )
    assert rotation_angle_deg(moved[:3, :3]) < 0.3
    assert np.abs(moved[[0, 2], 3]).max() < 0.1, "across the ridge; along it, y, the points hold nothing"
    assert found.rivals[0].rotation_deg == pytest.approx(180.0, abs=0.5)
    assert found.verdict == "fail"
    assert "sliding along" in found.weak_directions[0], "without ends nothing holds it along its ridge"
