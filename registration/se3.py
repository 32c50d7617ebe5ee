"""Rigid motions as 4x4 matrices, and small motions as (rotation vector rad, translation mm), in that order."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import StartError

SMALL_RAD = 1e-8
"""Below this angle, sine and cosine are those of their series to double precision."""

SMALL_SINE = 1e-9
"""Below this sine, an angle is its sine."""

NEAR_HALF_TURN = -0.99
"""Cosine of an angle from which on the axis is taken from the symmetric part of the matrix."""

MAX_ROW_ERROR, MAX_SHEAR = 1e-9, 1e-3
"""How far a given pose may be from rigid: poses are written to text files with few digits."""


def skew(vectors: FloatArray) -> FloatArray:
    """Return the matrices ``[v]x`` with ``[v]x u = v x u``; (..., 3) to (..., 3, 3)."""
    v = np.asarray(vectors, dtype=np.float64)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def rotation_from_vector(rotation_rad: FloatArray) -> FloatArray:
    """Exponential map (Rodrigues); rotation vectors (..., 3) rad to matrices (..., 3, 3)."""
    w = np.asarray(rotation_rad, dtype=np.float64)
    angle = np.sqrt(np.einsum("...i,...i->...", w, w))[..., None, None]
    small = angle < SMALL_RAD
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 1.0, np.sin(safe) / safe)
    second = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    k = skew(w)
    return np.asarray(np.eye(3) + first * k + second * (k @ k), dtype=np.float64)


def vector_from_rotation(rotation: FloatArray) -> FloatArray:
    """Logarithm of one rotation matrix (3, 3): the rotation vector (3,) in rad, of length 0 to pi."""
    axial = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine, cosine = float(np.linalg.norm(axial)) / 2.0, (float(np.trace(rotation)) - 1.0) / 2.0
    angle = float(np.arctan2(sine, cosine))
    if cosine > NEAR_HALF_TURN:
        return np.asarray(axial / 2.0 * (angle / sine if sine > SMALL_SINE else 1.0), dtype=np.float64)
    # Near half a turn the axial part vanishes; the symmetric one, (1 - cos) a a^T + cos, tells the axis but for a sign.
    squares = (rotation + rotation.T) / 2.0 - cosine * np.eye(3)
    axis = squares[:, int(np.argmax(np.diag(squares)))]
    axis = axis / np.linalg.norm(axis)
    return np.asarray(np.copysign(angle, axis @ axial) * axis, dtype=np.float64)


def pose(rotation: FloatArray, translation_mm: FloatArray) -> FloatArray:
    """Put rotations (..., 3, 3) and translations (..., 3) together to poses (..., 4, 4)."""
    rotation = np.asarray(rotation, dtype=np.float64)
    out = np.zeros((*rotation.shape[:-2], 4, 4))
    out[..., :3, :3] = rotation
    out[..., :3, 3] = translation_mm
    out[..., 3, 3] = 1.0
    return out


def inverse(fixed_from_moving: FloatArray) -> FloatArray:
    """Return ``moving_from_fixed`` of a rigid 4x4 pose."""
    rotation = fixed_from_moving[:3, :3].T
    return pose(rotation, -rotation @ fixed_from_moving[:3, 3])


def transform(fixed_from_moving: FloatArray, points: FloatArray) -> FloatArray:
    """Move points (N, 3) by a 4x4 pose."""
    return np.asarray(points @ fixed_from_moving[:3, :3].T + fixed_from_moving[:3, 3], dtype=np.float64)


def small_motion(x: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the 4x4 motion of ``x`` = (rotation rad, translation mm) (6,) about ``centre`` (3,).

    ``p -> R (p - centre) + centre + t``: the left perturbation that all covariances here speak of.
    """
    rotation = rotation_from_vector(x[:3])
    return pose(rotation, centre + x[3:] - rotation @ centre)


def displacement_jacobian(arm: FloatArray) -> FloatArray:
    """``J = [-[r]x I]`` (..., 3, 6): displacement by a small motion of points at `arm` (..., 3) from its centre."""
    identity = np.broadcast_to(np.eye(3), (*arm.shape, 3))
    return np.concatenate([-skew(arm), identity], axis=-1)


def displacement_covariance(covariance: FloatArray, arm: FloatArray) -> FloatArray:
    """``J Cov J^T`` (..., 3, 3) mm^2 at `arm` (..., 3) mm from the centre of a small motion's `covariance` (6, 6)."""
    jacobian = displacement_jacobian(arm)
    return np.asarray(jacobian @ covariance @ jacobian.swapaxes(-1, -2), dtype=np.float64)


def orthonormalised(fixed_from_moving: FloatArray) -> FloatArray:
    """Return the pose with its rotation block projected back onto SO(3); rounding adds up over many products."""
    u, _, vt = np.linalg.svd(fixed_from_moving[:3, :3])
    return pose(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt, fixed_from_moving[:3, 3])


def rotation_angle_deg(rotation: FloatArray) -> float:
    """Return the angle of a rotation matrix (3, 3) in degrees, accurate near 0 and near 180."""
    axial = (rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1])
    return float(np.degrees(np.arctan2(np.linalg.norm(axial), np.trace(rotation) - 1.0)))


def checked_pose(matrix: npt.ArrayLike) -> FloatArray:
    """Return `matrix` as a rigid 4x4 pose.

    Raises
    ------
    StartError
        If it is not 4x4 and finite, or holds scale, shear or a reflection.
    """
    given = np.asarray(matrix, dtype=np.float64)
    if given.shape != (4, 4) or not np.isfinite(given).all():
        raise StartError(f"a start pose is a finite 4x4 matrix, this one has shape {given.shape}")
    rotation = given[:3, :3]
    if np.abs(given[3] - (0.0, 0.0, 0.0, 1.0)).max() > MAX_ROW_ERROR:
        raise StartError(f"the last row of a start pose is 0 0 0 1, this one has {given[3].tolist()}")
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > MAX_SHEAR:
        raise StartError("the start pose holds scale or shear: give a rigid 4x4 pose, model_from_scanner, in mm")
    if np.linalg.det(rotation) < 0:
        raise StartError("the start pose mirrors (determinant -1): give a rigid 4x4 pose, model_from_scanner")
    return orthonormalised(given)


def frame_about(axis: FloatArray) -> FloatArray:
    """A rotation matrix (3, 3) whose last column is the unit vector `axis`."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
