"""ICP and its acceleration, the family of robust criteria, and the named baselines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.classic import LOSSES, head_and_hat, lm_icp, plane_icp
from picoradar.registration.classic.icp import icp
from picoradar.registration.model import Surface, build_fields
from picoradar.registration.se3 import pose, rotation_from_vector, transform


@pytest.fixture(scope="module")
def ellipsoid() -> Surface:
    """40 x 28 x 20 mm half axes."""
    u, v = np.meshgrid(
        np.linspace(0.02, np.pi - 0.02, 60), np.linspace(0, 2 * np.pi, 120, endpoint=False), indexing="ij"
    )
    unit = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3)
    a = (np.arange(59)[:, None] * 120 + np.arange(120)).ravel()
    b = (np.arange(59)[:, None] * 120 + (np.arange(120) + 1) % 120).ravel()
    faces = np.concatenate([np.stack([a, a + 120, b], axis=1), np.stack([b, a + 120, b + 120], axis=1)])
    return Surface(unit * [40.0, 28.0, 20.0], faces)


def points_on(surface: Surface, count: int, noise_mm: float) -> np.ndarray:
    rng = np.random.default_rng(7)
    return surface.vertices[rng.choice(len(surface.vertices), count, replace=False)] + rng.normal(
        0, noise_mm, (count, 3)
    )


START = pose(rotation_from_vector(np.radians([2.0, -1.0, 2.0])), np.array([1.0, -1.0, 1.0]))


def test_icp_never_gets_worse(ellipsoid: Surface) -> None:
    found = icp(points_on(ellipsoid, 200, 0.3), ellipsoid, START, max_iterations=60)
    assert (np.diff([entry.rms_mm for entry in found.history]) <= 1e-9).all()


def test_acceleration_saves_most_iterations_and_ends_at_the_same_pose(ellipsoid: Surface) -> None:
    points = points_on(ellipsoid, 150, 0.3)
    options: dict[str, Any] = {"max_iterations": 1500, "tolerance_mm2": 1e-12}
    plain = icp(points, ellipsoid, START, **options)
    fast = icp(points, ellipsoid, START, accelerated=True, **options)
    assert plain.converged
    assert fast.converged
    assert len(fast.history) < 0.5 * len(plain.history)
    np.testing.assert_allclose(fast.model_from_scanner, plain.model_from_scanner, atol=2e-4)


@pytest.mark.parametrize("name", LOSSES)
def test_every_criterion_keeps_the_good_and_counts_nothing_twice(name: str) -> None:
    residuals = np.concatenate([np.random.default_rng(0).normal(0.0, 0.3, 400), np.full(40, 8.0)])
    weights = LOSSES[name].weights(residuals)
    assert weights.shape == residuals.shape
    assert weights.min() >= 0.0
    assert weights.max() <= 1.0
    if name != "least squares":
        assert weights[:400].mean() > 4.0 * weights[400:].mean()


@pytest.mark.parametrize("name", ["Tukey", "Welsch", "one-sided", "LMedS", "LTS 60 %", "self-trimmed"])
def test_robust_criteria_withstand_outliers_where_least_squares_does_not(ellipsoid: Surface, name: str) -> None:
    points = points_on(ellipsoid, 300, 0.1)
    points[:60] *= 1.25
    error = {
        key: registration.pose_error(plane_icp(points, ellipsoid, START, LOSSES[key]), np.eye(4), np.zeros(3))
        for key in (name, "least squares")
    }
    assert error[name].translation_mm < 0.1
    assert error[name].translation_mm < error["least squares"].translation_mm


def test_lm_icp_agrees_with_the_tree_to_the_fields_error(ellipsoid: Surface) -> None:
    points = points_on(ellipsoid, 300, 0.2)
    low, high = ellipsoid.vertices.min(axis=0) - 6, ellipsoid.vertices.max(axis=0) + 6
    fine, _ = build_fields(ellipsoid, low, high, step_mm=0.7)
    by_field = lm_icp(points, fine, START, huber_mm=50.0)
    by_tree = plane_icp(points, ellipsoid, START, LOSSES["least squares"])
    error = registration.pose_error(by_field, by_tree, np.zeros(3))
    assert error.rotation_deg < 0.1
    assert error.translation_mm < 0.05


def test_head_and_hat_brings_the_hat_onto_the_head(ellipsoid: Surface) -> None:
    """Powell's search creeps along the valley of coupled turns and shifts, so the distance is judged, not the pose."""
    points = points_on(ellipsoid, 120, 0.1)
    found = head_and_hat(points, ellipsoid, START, np.zeros(3))
    before, after = (np.sqrt(np.mean(ellipsoid.distances(transform(p, points)) ** 2)) for p in (START, found))
    assert after < 0.3
    assert after < 0.3 * before
