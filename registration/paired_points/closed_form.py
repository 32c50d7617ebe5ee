"""Closed forms of the pose that lays paired points onto each other, least squares: Horn's and the SVD.

References
----------
Horn, J. Opt. Soc. Am. A 4:629 (1987). Arun, Huang, Blostein, PAMI 9:698 (1987). Umeyama, PAMI 13:376 (1991).
"""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.se3 import pose


def horn(fixed: FloatArray, moving: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Closed-form pose by unit quaternions (Horn 1987; dissertation, section 3.3.2, equations 3.7 to 3.10).

    Parameters
    ----------
    fixed, moving : (N, 3) arrays
        Paired points, mm.
    weights : (N,) array, optional
        Scalar weights of the pairs, not negative.

    Returns
    -------
    (4, 4) array
        ``fixed_from_moving``, least squares.
    """
    fixed_mean, moving_mean, s = correlation(fixed, moving, weights)
    delta = np.array([s[1, 2] - s[2, 1], s[2, 0] - s[0, 2], s[0, 1] - s[1, 0]])
    trace = np.trace(s)
    n = np.empty((4, 4))
    n[0, 0], n[0, 1:], n[1:, 0] = trace, delta, delta
    n[1:, 1:] = s + s.T - trace * np.eye(3)
    q0, q1, q2, q3 = np.linalg.eigh(n)[1][:, -1]
    rotation = np.array(
        [
            [q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3, 2 * (q1 * q2 - q0 * q3), 2 * (q1 * q3 + q0 * q2)],
            [2 * (q1 * q2 + q0 * q3), q0 * q0 + q2 * q2 - q1 * q1 - q3 * q3, 2 * (q2 * q3 - q0 * q1)],
            [2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), q0 * q0 + q3 * q3 - q1 * q1 - q2 * q2],
        ]
    )
    return pose(rotation, fixed_mean - rotation @ moving_mean)


def svd(fixed: FloatArray, moving: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Closed-form pose by singular values (Arun 1987, with Umeyama's sign); arguments and result as in `horn`."""
    fixed_mean, moving_mean, s = correlation(fixed, moving, weights)
    u, _, vt = np.linalg.svd(s.T)
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))]) @ vt
    return pose(rotation, fixed_mean - rotation @ moving_mean)


def correlation(
    fixed: FloatArray, moving: FloatArray, weights: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Both means (3,), and ``sum w (moving - mean) (fixed - mean)^T`` (3, 3)."""
    w = np.ones(len(fixed)) if weights is None else np.asarray(weights, dtype=np.float64)
    total = w.sum()
    fixed_mean, moving_mean = w @ fixed / total, w @ moving / total
    return fixed_mean, moving_mean, ((moving - moving_mean) * w[:, None]).T @ (fixed - fixed_mean)
