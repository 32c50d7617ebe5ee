"""Plane residuals: how they answer to a small motion, and the information that they carry.

Notes
-----
A point-to-plane residual changes with a small motion (rotation vector, translation) about a centre c by
``g_i = [(p_i - c) x n_i ; n_i]``; the information of all is ``H = sum w_i g_i g_i^T / sigma_i^2``.
"""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray

AT_ONCE = 32_000
"""Rows of a large cloud that are weighted in one go: their copy then stays in the cache."""


def plane_rows(points: FloatArray, normals: FloatArray, centre: FloatArray) -> FloatArray:
    """Rows ``g_i = [(p_i - c) x n_i ; n_i]`` (N, 6): how each plane residual answers to (rotation, translation)."""
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
    """Sum ``w_i g_i g_i^T`` (6, 6) of `rows` (N, 6) with weights (N,)."""
    total = np.zeros((6, 6))
    for first in range(0, len(rows), AT_ONCE):
        some = rows[first : first + AT_ONCE]
        total += (some * weight[first : first + AT_ONCE, None]).T @ some
    return total
