"""The error at a target to second order: where the rotation is poorly held, an arc is no straight line.

To first order a small rotation moves a target on a tangent, and the mean error is zero. The next term of the
exponential map bends the tangent to the arc: it shifts the mean towards the axis and widens the spread along it (the
approach of Moghari and Abolmaesumi, IEEE TMI 28:1796 (2009), here for any covariance of the pose).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from picoradar.registration._types import FloatArray


class SecondOrder(NamedTuple):
    """Mean (..., 3) mm and covariance (..., 3, 3) mm^2 of the error at targets."""

    mean_mm: FloatArray
    covariance_mm2: FloatArray

    @property
    def rms_mm(self) -> FloatArray:
        """Get the root mean square error (...) mm, of mean and spread together."""
        spread = np.trace(self.covariance_mm2, axis1=-2, axis2=-1)
        return np.asarray(np.sqrt(spread + np.sum(self.mean_mm**2, axis=-1)), dtype=np.float64)


def second_order(covariance: FloatArray, offset: FloatArray) -> SecondOrder:
    """Error at targets to second order in the rotation.

    With a rotation w ~ N(0, W) and a translation t the error is ``w x r + w x (w x r) / 2 - |w|^2 w x r / 6 + t``. The
    mean of the second term is ``(W - tr(W) I) r / 2``; its covariance, and that of the third term with the first and
    with t, are of the same order, and follow from the fourth moments of a normal vector (Isserlis 1918).

    Parameters
    ----------
    covariance : (6, 6) array
        Of (rotation rad, translation mm), a small motion about a centre.
    offset : (..., 3) array
        Targets less that centre, mm.
    """
    turn = covariance[:3, :3]
    # w x (w x r) = (w w^T - w^T w I) r: a quadratic form a^k_ij w_i w_j for each component k.
    eye = np.eye(3)
    forms = np.einsum("ki,...j->...kij", eye, offset) - np.einsum("ij,...k->...kij", eye, offset)
    forms = (forms + np.swapaxes(forms, -1, -2)) / 2.0
    turned = forms @ turn
    mean = np.trace(turned, axis1=-2, axis2=-1) / 2.0
    bent = np.einsum("...kij,...lji->...kl", turned, turned) / 2.0  # 2 tr(A W B W) / 4
    mixed, size = covariance[:3, 3:], np.trace(turn)
    shorter = covariance.copy()  # an arc is longer than its chord
    shorter[:3, :3] -= (size * turn + 2.0 * turn @ turn) / 3.0
    shorter[:3, 3:] -= (size * mixed + 2.0 * turn @ mixed) / 6.0
    shorter[3:, :3] = shorter[:3, 3:].T
    arm = np.concatenate([-_cross_matrix(offset), np.broadcast_to(eye, (*offset.shape[:-1], 3, 3))], axis=-1)
    straight = arm @ shorter @ np.swapaxes(arm, -1, -2)
    return SecondOrder(mean, straight + bent)


def _cross_matrix(v: FloatArray) -> FloatArray:
    """Matrices (..., 3, 3) of ``v x``."""
    zero = np.zeros(v.shape[:-1])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    rows = [np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, axis=-2)
