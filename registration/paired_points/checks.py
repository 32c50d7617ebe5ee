"""Paired points, weights and covariances as they are given: what is refused, and why."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import DegenerateError, PointsError

COLLINEAR = 1e-6
"""Points whose second extent is a smaller share of their first lie on one line."""

ASYMMETRY = 1e-9
"""Share of a covariance's largest entry by which it may be asymmetric: rounding of what was read from a file."""


def checked(points: npt.ArrayLike, name: str) -> FloatArray:
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3:
        raise PointsError(f"{name} points have shape {p.shape}: give (N, 3), in mm")
    if len(p) < 3:
        raise PointsError(f"{len(p)} {name} points: at least three pairs are needed")
    if not np.isfinite(p).all():
        raise PointsError(f"{name} points hold NaN or infinite values in row {int(np.argmin(np.isfinite(p).all(1)))}")
    return p


def checked_weights(weights: npt.ArrayLike | None, count: int) -> FloatArray:
    if weights is None:
        return np.ones(count)
    w = np.asarray(weights, dtype=np.float64)
    if w.shape != (count,) or not np.isfinite(w).all() or (w < 0).any() or np.count_nonzero(w) < 3:
        raise PointsError(f"weights are {count} finite numbers, not negative, at least three of them positive")
    return w


def checked_covariance(covariance: npt.ArrayLike | None, count: int, name: str) -> FloatArray:
    if covariance is None:
        return np.zeros((count, 3, 3))
    c = np.asarray(covariance, dtype=np.float64)
    if c.shape not in ((3, 3), (count, 3, 3)) or not np.isfinite(c).all():
        raise PointsError(f"{name} has shape {c.shape}: give finite (3, 3) or ({count}, 3, 3), in mm^2")
    c = np.broadcast_to(c, (count, 3, 3))
    if np.linalg.eigvalsh(c).min() < 0 or np.abs(c - c.swapaxes(1, 2)).max() > ASYMMETRY * np.abs(c).max():
        raise PointsError(f"{name} holds a matrix that is not symmetric and positive")
    return c


def refuse_collinear(points: FloatArray, name: str) -> None:
    """Refuse points on one line: the rotation about it is free, and no residual would show it."""
    centred = points - points.mean(axis=0)
    _, spread, axes = np.linalg.svd(centred, full_matrices=False)
    if spread[1] <= COLLINEAR * spread[0] or spread[0] == 0.0:
        axis = ", ".join(f"{v:.3f}" for v in axes[0])
        raise DegenerateError(
            f"the {name} points lie on one line, so the rotation about the axis ({axis}) is free: "
            "add a point off that line"
        )
