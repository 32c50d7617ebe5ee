"""Closed forms and covariances of paired points, against the computed check values of the formulas sheet."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.registration import DegenerateError, PointsError, paired_points
from picoradar.registration.paired_points import horn, parameter_covariance, svd
from picoradar.registration.se3 import pose, rotation_from_vector, skew, transform

FIDUCIALS = np.array([[0, 0, 0], [100, 0, 0], [0, 80, 0], [0, 0, 60]], dtype=float)
TARGET = np.array([50.0, 40.0, 120.0])


def random_pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return pose(rotation_from_vector(rng.normal(size=3) * 2.0), rng.normal(size=3) * 100.0)


def test_recovers_an_exact_pose() -> None:
    truth = random_pose(3)
    found = paired_points(transform(truth, FIDUCIALS), FIDUCIALS)
    np.testing.assert_allclose(found.fixed_from_moving, truth, atol=1e-12)
    assert found.fre_mm < 1e-12


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000), count=st.integers(3, 30), planar=st.booleans(), mirrored=st.booleans())
def test_horn_and_svd_agree_and_never_mirror(seed: int, count: int, planar: bool, mirrored: bool) -> None:
    rng = np.random.default_rng(seed)
    moving = rng.normal(size=(count, 3)) * 30.0
    if planar:
        moving[:, 2] = 0.0
    fixed = transform(random_pose(seed), moving * ([1, 1, -1] if mirrored else [1, 1, 1])) + rng.normal(size=(count, 3))
    weights = rng.uniform(0.1, 2.0, count)
    by_quaternion, by_svd = horn(fixed, moving, weights), svd(fixed, moving, weights)
    assert np.linalg.det(by_quaternion[:3, :3]) == pytest.approx(1.0, abs=1e-12)
    if paired_points(fixed, moving, weights=weights).uniqueness_gap > 0.05:
        np.testing.assert_allclose(by_quaternion, by_svd, atol=1e-12 * 1e2)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_does_not_depend_on_the_frames(seed: int) -> None:
    rng = np.random.default_rng(seed)
    moving, q = rng.normal(size=(8, 3)) * 30.0, random_pose(seed + 1)
    fixed = transform(random_pose(seed), moving) + rng.normal(size=(8, 3))
    base = paired_points(fixed, moving).fixed_from_moving
    turned = paired_points(transform(q, fixed), transform(q, moving)).fixed_from_moving
    np.testing.assert_allclose(turned, q @ base @ np.linalg.inv(q), atol=1e-9)


def test_half_turn() -> None:
    truth = pose(rotation_from_vector(np.array([0.0, np.pi, 0.0])), np.zeros(3))
    np.testing.assert_allclose(horn(transform(truth, FIDUCIALS), FIDUCIALS), truth, atol=1e-12)


def isotropic_tre2(fiducials: np.ndarray, target: np.ndarray, fle2: float) -> float:
    centre = fiducials.mean(axis=0)
    sigma = np.broadcast_to(np.eye(3) * fle2 / 3.0, (len(fiducials), 3, 3))
    covariance = parameter_covariance(fiducials, centre, sigma)
    j = np.concatenate([-skew(target - centre), np.eye(3)], axis=1)
    return float(np.trace(j @ covariance @ j.T))


def test_isotropic_tre_check_values() -> None:
    assert isotropic_tre2(FIDUCIALS, TARGET, 1.0) == pytest.approx(1.273064, abs=5e-7)
    square = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], dtype=float)
    assert isotropic_tre2(square, np.array([2.0, 0, 0]), 1.0) == pytest.approx(0.75, abs=1e-12)


def test_isotropic_tre_by_simulation() -> None:
    rng = np.random.default_rng(1)
    squared = []
    for _ in range(2500):
        noisy = FIDUCIALS + rng.normal(0.0, 0.3 / np.sqrt(3.0), FIDUCIALS.shape)
        squared.append(((transform(horn(noisy, FIDUCIALS), TARGET[None])[0] - TARGET) ** 2).sum())
    assert np.sqrt(np.mean(squared)) == pytest.approx(0.3385, rel=0.04)


def test_fre_ratio_by_simulation() -> None:
    rng = np.random.default_rng(2)
    fiducials = rng.normal(size=(6, 3)) * 40.0
    fre2 = [
        paired_points(fiducials + rng.normal(0.0, 0.5 / np.sqrt(3.0), (6, 3)), fiducials).fre_mm ** 2
        for _ in range(1000)
    ]
    assert np.sqrt(np.mean(fre2) / 6.0) / 0.5 * 6**0.5 == pytest.approx(np.sqrt(1.0 - 2.0 / 6.0), rel=0.05)


def anisotropic_sigma() -> np.ndarray:
    beam = np.diag([0.1, 0.1, 0.6]) ** 2
    return np.stack([beam, beam, beam, np.diag([0.5, 0.5, 1.2]) ** 2])


def test_anisotropic_check_values() -> None:
    found = paired_points(FIDUCIALS, FIDUCIALS, fixed_covariance=anisotropic_sigma())
    covariance = found.tre_covariance(TARGET)
    assert float(found.tre(TARGET)) == pytest.approx(1.0773, abs=5e-5)
    np.testing.assert_allclose(np.diag(covariance), [0.4527, 0.5712, 0.1367], atol=5e-5)
    unweighted = parameter_covariance(FIDUCIALS, FIDUCIALS.mean(axis=0), anisotropic_sigma(), np.ones(4))
    j = np.concatenate([-skew(TARGET - FIDUCIALS.mean(axis=0)), np.eye(3)], axis=1)
    assert np.sqrt(np.trace(j @ unweighted @ j.T)) == pytest.approx(1.1857, abs=5e-5)


def test_anisotropic_weighting_by_simulation() -> None:
    rng = np.random.default_rng(4)
    sigma = anisotropic_sigma()
    deviation = np.sqrt(np.diagonal(sigma, axis1=1, axis2=2))
    truth = random_pose(9)
    squared = []
    for _ in range(400):
        noisy = transform(truth, FIDUCIALS) + rng.normal(size=(4, 3)) * deviation
        found = paired_points(noisy, FIDUCIALS, fixed_covariance=sigma).fixed_from_moving
        squared.append(((transform(found, FIDUCIALS) - transform(truth, FIDUCIALS))[3] ** 2).sum())
    predicted = paired_points(transform(truth, FIDUCIALS), FIDUCIALS, fixed_covariance=sigma)
    at_last_fiducial = float(predicted.tre(transform(truth, FIDUCIALS)[3]))
    assert np.sqrt(np.mean(squared)) == pytest.approx(at_last_fiducial, rel=0.1)


def test_equal_isotropic_covariances_are_the_closed_form() -> None:
    rng = np.random.default_rng(5)
    fixed = transform(random_pose(5), FIDUCIALS) + rng.normal(size=(4, 3))
    weighted = paired_points(fixed, FIDUCIALS, fixed_covariance=np.eye(3) * 0.04, moving_covariance=np.eye(3) * 0.01)
    np.testing.assert_allclose(weighted.fixed_from_moving, horn(fixed, FIDUCIALS), atol=1e-9)


def test_collinear_points_are_refused_with_the_free_axis() -> None:
    line = np.outer(np.arange(5.0), [1.0, 0.0, 0.0])
    with pytest.raises(DegenerateError, match=r"axis \((-?1\.000), -?0\.000, -?0\.000\) is free"):
        paired_points(line, line)


@pytest.mark.parametrize(
    ("fixed", "moving", "message"),
    [
        (np.zeros((2, 3)), np.zeros((2, 3)), "at least three"),
        (FIDUCIALS, FIDUCIALS[:3], "come in pairs"),
        (FIDUCIALS * np.nan, FIDUCIALS, "NaN"),
        (FIDUCIALS[:, :2], FIDUCIALS, "shape"),
    ],
)
def test_bad_pairs_are_refused(fixed: np.ndarray, moving: np.ndarray, message: str) -> None:
    with pytest.raises(PointsError, match=message):
        paired_points(fixed, moving)
