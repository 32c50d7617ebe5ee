"""Weights that matter, the error at a target to second order, and pairs that are off or exchanged."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.registration import DegenerateError, PointsError, paired_points
from picoradar.registration.paired_points import horn, judge_pairs, second_order
from picoradar.registration.se3 import displacement_covariance, pose, rotation_from_vector, transform

FLE_MM = 0.6  # root mean square over three axes


def pairs(seed: int, count: int = 7, fle_mm: float = FLE_MM) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    moving = rng.normal(size=(count, 3)) * 40.0
    truth = pose(rotation_from_vector(rng.normal(size=3)), rng.normal(size=3) * 100.0)
    return transform(truth, moving) + rng.normal(0.0, fle_mm / np.sqrt(3.0), (count, 3)), moving


def test_a_pair_of_weight_zero_does_not_condemn_the_others() -> None:
    fixed, moving = pairs(1, 8)
    fixed[6:] += 150.0
    weighted = paired_points(fixed, moving, weights=[1.0] * 6 + [0.0] * 2)
    alone = paired_points(fixed[:6], moving[:6])
    assert weighted.fre_mm == pytest.approx(alone.fre_mm, rel=1e-9)
    assert float(weighted.tre([10.0, 20.0, 30.0])) == pytest.approx(float(alone.tre([10.0, 20.0, 30.0])), rel=1e-9)
    assert np.linalg.norm(weighted.residuals_mm[7]) > 200.0


def test_equal_weights_are_no_weights() -> None:
    fixed, moving = pairs(2)
    equal, none = paired_points(fixed, moving, weights=np.full(7, 3.0)), paired_points(fixed, moving)
    assert equal.fre_mm == pytest.approx(none.fre_mm, rel=1e-12)
    np.testing.assert_allclose(equal.covariance, none.covariance, rtol=1e-9, atol=1e-12)


def test_the_error_predicted_with_weights_is_that_of_a_simulation() -> None:
    rng = np.random.default_rng(3)
    moving, target = rng.normal(size=(8, 3)) * 40.0, np.array([60.0, -20.0, 30.0])
    weights = np.array([1.0, 1.0, 1.0, 4.0, 4.0, 0.25, 0.25, 0.0])
    sd = 0.5 / np.sqrt(np.where(weights > 0, weights, 1e-4))
    errors, predicted = [], []
    for _ in range(3000):
        found = paired_points(moving + rng.normal(size=(8, 3)) * sd[:, None], moving, weights=weights)
        errors.append(((transform(found.fixed_from_moving, target[None])[0] - target) ** 2).sum())
        predicted.append(float(found.tre(target)) ** 2)
    assert np.mean(predicted) == pytest.approx(np.mean(errors), rel=0.06)


def test_weights_that_leave_a_line_are_refused_with_the_free_axis() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 5, 0]])
    with pytest.raises(DegenerateError, match=r"axis \((-)?1\.000"):
        paired_points(points, points, weights=[1, 1, 1, 0])


def test_an_arc_is_no_straight_line() -> None:
    """Monte-Carlo of rotations of 16 deg: the first order knows no mean, and has the spread of the chords too long."""
    rng = np.random.default_rng(4)
    root = np.diag([0.21, 0.12, 0.05, 0.2, 0.3, 0.1]) @ (np.eye(6) + 0.3 * rng.normal(size=(6, 6)))
    covariance, offset = root @ root.T, np.array([30.0, 50.0, -20.0])
    motions = rng.multivariate_normal(np.zeros(6), covariance, 200_000)
    moved = np.einsum("nij,j->ni", rotation_from_vector(motions[:, :3]), offset) - offset + motions[:, 3:]
    found = second_order(covariance, offset)
    size = float(np.sqrt((moved**2).sum(axis=1).mean()))
    np.testing.assert_allclose(found.mean_mm, moved.mean(axis=0), atol=0.01 * size)
    np.testing.assert_allclose(found.covariance_mm2, np.cov(moved.T), atol=0.01 * size**2)
    straight = np.trace(displacement_covariance(covariance, offset))
    assert abs(found.rms_mm - size) < 0.5 * abs(np.sqrt(straight) - size)


def test_many_targets_at_once_are_each_by_itself() -> None:
    covariance, offsets = np.diag([0.1, 0.2, 0.1, 1.0, 1.0, 1.0]), np.random.default_rng(5).normal(size=(4, 5, 3)) * 50
    together = second_order(covariance, offsets)
    one = second_order(covariance, offsets[2, 3])
    np.testing.assert_allclose(together.mean_mm[2, 3], one.mean_mm)
    np.testing.assert_allclose(together.covariance_mm2[2, 3], one.covariance_mm2)


@pytest.mark.parametrize("fle_mm", [FLE_MM, None])
def test_good_pairs_are_seldom_accused(fle_mm: float | None) -> None:
    accused = [bool(judge_pairs(*pairs(seed), fle_mm=fle_mm).sentences) for seed in range(600)]
    assert np.mean(accused) < 0.04  # three tests of 1 % at most, and four standard deviations of 600 tries


@pytest.mark.parametrize(("fle_mm", "count"), [(FLE_MM, 4), (FLE_MM, 7), (None, 6), (None, 8)])
def test_the_pair_that_is_off_is_named_even_where_another_has_the_largest_residual(
    fle_mm: float | None, count: int
) -> None:
    named, largest = 0, 0
    for seed in range(60):
        fixed, moving = pairs(seed, count)
        bad = seed % count
        fixed[bad] += 8.0 * rotation_from_vector(np.random.default_rng(seed).normal(size=3))[:, 0]
        judged = judge_pairs(fixed, moving, fle_mm=fle_mm, names=[f"point {k}" for k in range(count)])
        named += judged.off == bad and f"point {bad}" in judged.sentences[0]
        largest += int(np.argmax(judged.residual_mm)) == bad
    assert named >= (45 if count == 4 else 57)  # of four pairs three fit so well without another one, too
    assert named >= largest


@pytest.mark.parametrize(("fle_mm", "count"), [(FLE_MM, 4), (None, 6)])
def test_exchanged_pairs_are_named(fle_mm: float | None, count: int) -> None:
    right = 0
    for seed in range(60):
        fixed, moving = pairs(seed, count)
        fixed[[1, 3]] = fixed[[3, 1]]
        judged = judge_pairs(fixed, moving, fle_mm=fle_mm)
        right += judged.exchanged == (1, 3) and "pair 2 and pair 4" in judged.sentences[0]
    assert right >= 55


def test_residuals_that_are_expected_are_those_of_a_simulation() -> None:
    rng = np.random.default_rng(6)
    moving = rng.normal(size=(5, 3)) * [60.0, 30.0, 10.0]
    noisy = moving + rng.normal(0.0, FLE_MM / np.sqrt(3.0), (2000, 5, 3))
    squared = np.mean([((one - transform(horn(one, moving), moving)) ** 2).sum(axis=1) for one in noisy], axis=0)
    judged = judge_pairs(moving, moving, fle_mm=FLE_MM)
    np.testing.assert_allclose(judged.expected_mm, np.sqrt(squared), rtol=0.05)
    assert judged.expected_fre_mm == pytest.approx(np.sqrt(squared.mean()), rel=0.03)


def test_pairs_that_agree_less_than_their_localisation_are_told_so() -> None:
    fixed, moving = pairs(7, 6, fle_mm=4.0)
    assert (
        "expected" in judge_pairs(fixed, moving, fle_mm=0.3).sentences[0]
        or judge_pairs(fixed, moving, fle_mm=0.3).off is not None
    )


def test_a_localisation_error_that_is_none_is_refused() -> None:
    with pytest.raises(PointsError, match="fle_mm"):
        judge_pairs(*pairs(8), fle_mm=0.0)
