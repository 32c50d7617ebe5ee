"""Paired points with full covariances: the weighted pose, and how uncertain any pose of paired points is.

References
----------
Balachandran, Fitzpatrick, SPIE 7261 (2009). Danilchenko, Fitzpatrick, IEEE TMI 30:679 (2011).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.least_squares import Damping, minimised
from picoradar.registration.se3 import displacement_jacobian, transform

MAX_STEPS, SETTLED = 100, 1e-12
"""Gauss-Newton steps at most, and the step, as a share of the points' size, that is rounding alone."""


def parameter_covariance(
    points: FloatArray, centre: FloatArray, sigma: FloatArray, weights: FloatArray | None = None
) -> FloatArray:
    """Covariance (6, 6) of (rotation rad, translation mm) about `centre` for registered points.

    ``A^-1 (sum J^T M Sigma M J) A^-1`` with ``A = sum J^T M J`` and ``J = [-[p]x I]``; ``M`` is `weights` times the
    identity, or ``Sigma^-1`` (the ideal weighting) when no weights are given (Danilchenko and Fitzpatrick 2011).

    Parameters
    ----------
    points : (N, 3) array
        Fiducials in the fixed frame, mm.
    centre : (3,) array
        The point that the small motion turns about.
    sigma : (N, 3, 3) array
        Localisation covariance of each pair, fixed frame, mm^2.
    weights : (N,) array, optional
        Scalar weights with which the pose was found.
    """
    jacobian = displacement_jacobian(points - centre)
    if weights is None:
        metric = np.linalg.inv(sigma)
        return np.linalg.inv(np.einsum("nij,nik,nkl->jl", jacobian, metric, jacobian))
    bread = np.linalg.inv(np.einsum("nij,n,nil->jl", jacobian, weights, jacobian))
    meat = np.einsum("nij,n,nik,n,nkl->jl", jacobian, weights, sigma, weights, jacobian, optimize=True)
    return np.asarray(bread @ meat @ bread, dtype=np.float64)


@dataclass(frozen=True)
class _PairedFactor:
    """Squared distances of pairs, each in the metric of its covariance at one pose."""

    fixed: FloatArray
    pose: FloatArray
    moved: FloatArray
    sigma: FloatArray

    @property
    def centre(self) -> FloatArray:
        """Centroid (3,) of the fixed points."""
        return np.asarray(self.fixed.mean(axis=0), dtype=np.float64)

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """H (6, 6) and g (6,)."""
        metric = np.linalg.inv(self.sigma)
        jacobian = displacement_jacobian(self.moved - self.centre)
        normal = np.einsum("nij,nik,nkl->jl", jacobian, metric, jacobian, optimize=True)
        gradient = np.einsum("nij,nik,nk->j", jacobian, metric, self.moved - self.fixed, optimize=True)
        return normal, gradient


def weighted_pose(
    b: FloatArray, a: FloatArray, sigma_b: FloatArray, sigma_a: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Anisotropic, inhomogeneous solution by Gauss-Newton with the covariances refreshed in every pass."""
    centre = b.mean(axis=0)
    size = float(np.sqrt(((b - centre) ** 2).sum(axis=1).mean()))

    def factor_at(solution: FloatArray) -> _PairedFactor:
        rotation = solution[:3, :3]
        return _PairedFactor(b, solution, transform(solution, a), rotation @ sigma_a @ rotation.T + sigma_b)

    def settled(x: FloatArray) -> bool:
        return bool(np.linalg.norm(x[:3]) * size + np.linalg.norm(x[3:]) < SETTLED * size)

    solution = minimised(factor_at, start, settled=settled, max_steps=MAX_STEPS, damping=Damping())
    end = factor_at(solution)
    return solution, parameter_covariance(end.moved, centre, end.sigma)
