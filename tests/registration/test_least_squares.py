"""The damped Gauss-Newton step that all solvers take, and the loop about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from picoradar.registration.least_squares import Damping, damped_step, minimised, plane_rows
from picoradar.registration.se3 import pose, rotation_from_vector, small_motion, transform

RNG = np.random.default_rng(4)
POINTS = RNG.normal(0.0, 20.0, (60, 3))
NORMALS = RNG.normal(size=(60, 3)) / np.sqrt(3.0)
TRUTH = pose(rotation_from_vector(np.array([0.3, -0.2, 0.1])), np.array([4.0, -3.0, 2.0]))


@dataclass(frozen=True)
class Planes:
    """Points on planes through where they belong."""

    pose: np.ndarray
    exaggeration: float = 1.0

    @property
    def centre(self) -> np.ndarray:
        return transform(self.pose, POINTS).mean(axis=0)

    @property
    def residuals(self) -> np.ndarray:
        moved = transform(self.pose, POINTS) - transform(TRUTH, POINTS)
        return np.asarray(np.einsum("ij,ij->i", NORMALS, moved))

    def normal_equations(self) -> tuple[np.ndarray, np.ndarray]:
        rows = plane_rows(transform(self.pose, POINTS), NORMALS, self.centre)
        return rows.T @ rows / self.exaggeration, rows.T @ self.residuals


def test_the_step_undoes_a_small_motion() -> None:
    x = np.array([1e-5, -2e-5, 3e-5, 1e-4, 2e-4, -1e-4])
    at = Planes(TRUTH)
    off = Planes(small_motion(x, at.centre) @ TRUTH)
    np.testing.assert_allclose(damped_step(*off.normal_equations()), -x, rtol=1e-3, atol=1e-8)


def test_many_steps_at_once_are_the_single_ones() -> None:
    systems = [Planes(small_motion(RNG.normal(size=6) * 0.01, np.zeros(3)) @ TRUTH).normal_equations() for _ in "abc"]
    normal, gradient = (np.stack(part) for part in zip(*systems, strict=True))
    untouched = normal.copy()
    ridge = np.array([4.0, 4.0, 4.0, 0.5, 0.5, 0.5])
    together = damped_step(normal, gradient, ridge, 0.1)
    np.testing.assert_array_equal(normal, untouched)
    for one, (h, g) in zip(together, systems, strict=True):
        np.testing.assert_array_equal(one, damped_step(h, g, ridge, 0.1))
        expected = -np.linalg.inv(h + 0.1 * np.diag(np.diag(h)) + np.diag(ridge)) @ g
        np.testing.assert_allclose(one, expected, rtol=1e-9)


@pytest.mark.parametrize("exaggeration", [1.0, 5.0])
def test_damping_saves_steps_that_overshoot(exaggeration: float) -> None:
    """Steps five times too long diverge; those that do not improve are taken back and damped."""

    def kept(here: Planes, ahead: Planes) -> bool:
        return bool(ahead.residuals @ ahead.residuals <= here.residuals @ here.residuals)

    def settled(x: np.ndarray) -> bool:
        return bool(np.abs(x).max() < 1e-12)

    found = minimised(
        lambda at: Planes(at, exaggeration),
        np.eye(4),
        settled=settled,
        max_steps=200,
        damping=Damping(first=1e-3, smallest=1e-9),
        kept=kept,
    )
    np.testing.assert_allclose(found, TRUTH, atol=1e-8)


def test_gauss_newton_takes_few_steps() -> None:
    made: list[np.ndarray] = []

    def factor_at(at: np.ndarray) -> Planes:
        made.append(at)
        return Planes(at)

    def settled(x: np.ndarray) -> bool:
        return bool(np.abs(x).max() < 1e-10)

    found = minimised(factor_at, np.eye(4), settled=settled, max_steps=50, damping=Damping())
    np.testing.assert_allclose(found, TRUTH, atol=1e-9)
    assert len(made) < 9, "quadratic convergence"
