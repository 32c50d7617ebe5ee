"""Least squares on SE(3): plane residuals, their information, and the damped Gauss-Newton step that all solvers take.

A point-to-plane residual changes with a small motion x (rotation vector, translation) about a centre c by
``g_i = [(p_i - c) x n_i ; n_i]`` [eq. 2]; the information of all is ``H = sum w_i g_i g_i^T`` [eq. 9]. Equation numbers
are those of ``docs/registration.md``.

References
----------
Levenberg (1944), Marquardt (1963): damping. Madsen, Nielsen, Tingleff, Methods for non-linear least squares problems
(2004).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.se3 import small_motion

BLOCK_ROWS = 32_000
"""Rows of a large cloud that are weighted in one go: their copy then stays in the cache."""


def plane_rows(points: FloatArray, normals: FloatArray, centre: FloatArray) -> FloatArray:
    """Rows ``g_i`` (N, 6): how each plane residual answers to (rotation, translation) about `centre` (3,) [eq. 2]."""
    rows = np.empty((len(points), 6))
    x, y, z = (points - centre).T
    n0, n1, n2 = normals.T
    rows[:, 0], rows[:, 1], rows[:, 2] = y * n2 - z * n1, z * n0 - x * n2, x * n1 - y * n0
    rows[:, 3:] = normals
    return rows


def information(rows: FloatArray, sigma_mm: FloatArray) -> FloatArray:
    """Information matrix (6, 6) of plane residuals with standard deviations `sigma_mm` (N,)."""
    return weighted_squares(rows, 1.0 / sigma_mm**2)


def weighted_squares(rows: FloatArray, weight: FloatArray) -> FloatArray:
    """Sum ``w_i g_i g_i^T`` (K, K) of `rows` (N, K) with weights (N,)."""
    total = np.zeros((rows.shape[1], rows.shape[1]))
    for first in range(0, len(rows), BLOCK_ROWS):
        some = rows[first : first + BLOCK_ROWS]
        total += (some * weight[first : first + BLOCK_ROWS, None]).T @ some
    return total


def damped_step(
    normal: FloatArray, gradient: FloatArray, ridge: FloatArray | float = 0.0, damping: float = 0.0
) -> FloatArray:
    """Gauss-Newton steps ``x = -(H + damping diag(H) + diag(ridge))^-1 g`` [eq. 9], of one pose or of many at once.

    Parameters
    ----------
    normal : (..., 6, 6) array
        H, the sum of ``w_i g_i g_i^T``.
    gradient : (..., 6) array
        g, the sum of ``w_i g_i e_i``.
    ridge : (..., 6) array or float
        Stiffness of an a priori step of nil.
    damping : float
        Levenberg-Marquardt's, relative to the diagonal.

    Returns
    -------
    (..., 6) array
        Rotation vector (rad) and translation (mm).
    """
    matrix = np.array(normal, order="C")
    diagonal = matrix.reshape(*matrix.shape[:-2], 36)[..., ::7]  # a view
    diagonal += damping * diagonal + ridge
    return np.asarray(-np.linalg.solve(matrix, gradient[..., None])[..., 0], dtype=np.float64)


class Factor(Protocol):
    """A sum of weighted squares about one pose."""

    @property
    def pose(self) -> FloatArray:
        """The pose (4, 4)."""
        ...

    @property
    def centre(self) -> FloatArray:
        """The point (3,) that a small motion turns about."""
        ...

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """H (6, 6) and g (6,) [eq. 9]."""
        ...


AnyFactor = TypeVar("AnyFactor", bound=Factor)


@dataclass(frozen=True)
class Damping:
    """Levenberg-Marquardt damping: it falls by `factor` with each step that is kept, and rises with each that is not.

    Attributes
    ----------
    first, smallest : float
        Relative to the diagonal of the normal matrix; nil of both is Gauss-Newton.
    ridge : float
        Added to the diagonal.
    factor : float
        Marquardt's 10.
    """

    first: float = 0.0
    smallest: float = 0.0
    ridge: float = 0.0
    factor: float = 10.0


def minimised(
    factor_at: Callable[[FloatArray], AnyFactor],
    start: FloatArray,
    *,
    settled: Callable[[FloatArray], bool],
    max_steps: int,
    damping: Damping,
    kept: Callable[[AnyFactor, AnyFactor], bool] | None = None,
) -> FloatArray:
    """Pose (4, 4) where damped Gauss-Newton steps from `start` have settled.

    Parameters
    ----------
    factor_at : callable
        Makes the factor of a pose (4, 4).
    start : (4, 4) array
    settled : callable
        Whether a step (6,) was the last one.
    max_steps : int
    damping : Damping
    kept : callable, optional
        Whether a step from one factor to another is kept; all are when not given.
    """
    here, strength = factor_at(start), damping.first
    for _ in range(max_steps):
        x = damped_step(*here.normal_equations(), damping.ridge, strength)
        ahead = factor_at(small_motion(x, here.centre) @ here.pose)
        if kept is None or kept(here, ahead):
            here, strength = ahead, max(strength / damping.factor, damping.smallest)
        else:
            strength *= damping.factor
        if settled(x):
            break
    return here.pose
