"""Registration of paired points: Horn's and the SVD closed form, scalar weights, and full covariances per point.

There is no scale and no reflection in any of them: the result is always rigid.

References
----------
Horn, J. Opt. Soc. Am. A 4:629 (1987). Arun, Huang, Blostein, PAMI 9:698 (1987). Umeyama, PAMI 13:376 (1991).
Fitzpatrick, West, Maurer, IEEE TMI 17:694 (1998). Balachandran, Fitzpatrick, SPIE 7261 (2009).
Danilchenko, Fitzpatrick, IEEE TMI 30:679 (2011).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import DegenerateError, PointsError
from picoradar.registration.se3 import pose, rotation_from_vector, skew, transform


@dataclass(frozen=True)
class PairedPoints:
    """Result of a paired-point registration.

    Attributes
    ----------
    fixed_from_moving : (4, 4) array
        Rigid pose.
    fre_mm : float
        Fiducial registration error, root mean square distance of the pairs after registration. It says
        nothing about the error at a target; :meth:`tre` does.
    residuals_mm : (N, 3) array
        ``fixed - fixed_from_moving(moving)``.
    covariance : (6, 6) array
        Of (rotation rad, translation mm), a left perturbation about `centre`.
    centre : (3,) array
        Centroid of the fixed points.
    uniqueness_gap : float
        ``d2 + sign * d3`` of the correlation matrix, relative to ``d1``; zero exactly when the rotation is not unique.
    """

    fixed_from_moving: FloatArray
    fre_mm: float
    residuals_mm: FloatArray
    covariance: FloatArray
    centre: FloatArray
    uniqueness_gap: float

    def tre_covariance(self, target: npt.ArrayLike) -> FloatArray:
        """Predicted covariance (..., 3, 3) mm^2 of the target registration error at `target` (..., 3), fixed frame."""
        arm = np.asarray(target, dtype=np.float64) - self.centre
        jacobian = np.concatenate([-skew(arm), np.broadcast_to(np.eye(3), (*arm.shape, 3))], axis=-1)
        return np.asarray(jacobian @ self.covariance @ jacobian.swapaxes(-1, -2), dtype=np.float64)

    def tre(self, target: npt.ArrayLike) -> FloatArray:
        """Predicted root mean square target registration error (...) mm at `target` (..., 3), fixed frame."""
        variance = np.trace(self.tre_covariance(target), axis1=-2, axis2=-1)
        return np.asarray(np.sqrt(variance), dtype=np.float64)


def horn(fixed: FloatArray, moving: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Closed-form pose by unit quaternions (Horn 1987; dissertation S 3.3.2, equations 3.7 to 3.10).

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
    fixed_mean, moving_mean, s = _correlation(fixed, moving, weights)
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
    fixed_mean, moving_mean, s = _correlation(fixed, moving, weights)
    u, _, vt = np.linalg.svd(s.T)
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))]) @ vt
    return pose(rotation, fixed_mean - rotation @ moving_mean)


def _correlation(
    fixed: FloatArray, moving: FloatArray, weights: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Both means (3,), and ``sum w (moving - mean) (fixed - mean)^T`` (3, 3)."""
    w = np.ones(len(fixed)) if weights is None else np.asarray(weights, dtype=np.float64)
    total = w.sum()
    fixed_mean, moving_mean = w @ fixed / total, w @ moving / total
    return fixed_mean, moving_mean, ((moving - moving_mean) * w[:, None]).T @ (fixed - fixed_mean)


def paired_points(
    fixed: npt.ArrayLike,
    moving: npt.ArrayLike,
    *,
    weights: npt.ArrayLike | None = None,
    fixed_covariance: npt.ArrayLike | None = None,
    moving_covariance: npt.ArrayLike | None = None,
) -> PairedPoints:
    """Register paired points, with a prediction of the error at any target.

    Without covariances the closed form is used, and the localisation error (FLE) is taken to be isotropic and
    estimated from the residuals: ``<FLE^2> = <FRE^2> / (1 - 2/N)``. With covariances the weighted sum
    ``sum (b - R a - t)^T Sigma^-1 (b - R a - t)``, ``Sigma = R Sigma_moving R^T + Sigma_fixed``, is minimised.

    Parameters
    ----------
    fixed, moving : (N, 3) arrays
        Paired points, mm, N at least 3 and not on one line.
    weights : (N,) array, optional
        Scalar weights; not together with covariances.
    fixed_covariance, moving_covariance : (3, 3) or (N, 3, 3) arrays, optional
        Localisation covariance in each frame, mm^2.

    Raises
    ------
    PointsError
        For arrays of wrong shape, with NaN or infinite values, or with fewer than three pairs.
    DegenerateError
        For points that are collinear (the free axis is named).

    Examples
    --------
    >>> import numpy as np
    >>> from picoradar.registration import paired_points
    >>> fixed = np.array([[0.0, 0, 0], [50, 0, 0], [0, 40, 0], [0, 0, 30]])
    >>> found = paired_points(fixed, fixed - [1, 2, 3])
    >>> found.fixed_from_moving[:3, 3].round(6)
    array([1., 2., 3.])
    >>> found.fre_mm < 1e-9
    True
    """
    b, a = _checked(fixed, "fixed"), _checked(moving, "moving")
    if a.shape != b.shape:
        raise PointsError(f"paired points come in pairs: {len(b)} fixed and {len(a)} moving points were given")
    w = _checked_weights(weights, len(b))
    for name, points in (("fixed", b), ("moving", a)):
        _refuse_collinear(points, name)
    has_covariance = fixed_covariance is not None or moving_covariance is not None
    if has_covariance and weights is not None:
        raise PointsError("give either scalar weights or covariances, not both")
    start = horn(b, a, w)
    if has_covariance:
        sigma_b = _checked_covariance(fixed_covariance, len(b), "fixed_covariance")
        sigma_a = _checked_covariance(moving_covariance, len(b), "moving_covariance")
        solution, covariance = _weighted(b, a, sigma_b, sigma_a, start)
    else:
        solution = start
        residuals = b - transform(start, a)
        fle2 = float((residuals**2).sum() / len(b)) / (1.0 - 2.0 / len(b))
        covariance = parameter_covariance(
            transform(start, a), b.mean(axis=0), np.broadcast_to(np.eye(3) * fle2 / 3.0, (len(b), 3, 3)), w
        )
    residuals = b - transform(solution, a)
    d = np.linalg.svd(_correlation(b, a, w)[2])
    sign = np.sign(np.linalg.det(d[0]) * np.linalg.det(d[2]))
    return PairedPoints(
        fixed_from_moving=solution,
        fre_mm=float(np.sqrt((residuals**2).sum(axis=1).mean())),
        residuals_mm=residuals,
        covariance=covariance,
        centre=b.mean(axis=0),
        uniqueness_gap=float((d[1][1] + sign * d[1][2]) / d[1][0]),
    )


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
    jacobian = np.concatenate([-skew(points - centre), np.broadcast_to(np.eye(3), (len(points), 3, 3))], axis=2)
    if weights is None:
        metric = np.linalg.inv(sigma)
        return np.linalg.inv(np.einsum("nij,nik,nkl->jl", jacobian, metric, jacobian))
    bread = np.linalg.inv(np.einsum("nij,n,nil->jl", jacobian, weights, jacobian))
    meat = np.einsum("nij,n,nik,n,nkl->jl", jacobian, weights, sigma, weights, jacobian, optimize=True)
    return np.asarray(bread @ meat @ bread, dtype=np.float64)


def _weighted(
    b: FloatArray, a: FloatArray, sigma_b: FloatArray, sigma_a: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Anisotropic, inhomogeneous solution by Gauss-Newton with the covariances refreshed in every pass."""
    centre, solution = b.mean(axis=0), start
    size = float(np.sqrt(((b - centre) ** 2).sum(axis=1).mean()))
    for _ in range(100):
        rotation = solution[:3, :3]
        sigma = rotation @ sigma_a @ rotation.T + sigma_b
        metric = np.linalg.inv(sigma)
        p = transform(solution, a)
        jacobian = np.concatenate([-skew(p - centre), np.broadcast_to(np.eye(3), (len(p), 3, 3))], axis=2)
        normal = np.einsum("nij,nik,nkl->jl", jacobian, metric, jacobian, optimize=True)
        x = np.linalg.solve(normal, np.einsum("nij,nik,nk->j", jacobian, metric, b - p, optimize=True))
        step = pose(rotation_from_vector(x[:3]), centre + x[3:] - rotation_from_vector(x[:3]) @ centre)
        solution = step @ solution
        if np.linalg.norm(x[:3]) * size + np.linalg.norm(x[3:]) < 1e-12 * size:
            break
    rotation = solution[:3, :3]
    return solution, parameter_covariance(transform(solution, a), centre, rotation @ sigma_a @ rotation.T + sigma_b)


def _checked(points: npt.ArrayLike, name: str) -> FloatArray:
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3:
        raise PointsError(f"{name} points have shape {p.shape}: give (N, 3), in mm")
    if len(p) < 3:
        raise PointsError(f"{len(p)} {name} points: at least three pairs are needed")
    if not np.isfinite(p).all():
        raise PointsError(f"{name} points hold NaN or infinite values in row {int(np.argmin(np.isfinite(p).all(1)))}")
    return p


def _checked_weights(weights: npt.ArrayLike | None, count: int) -> FloatArray:
    if weights is None:
        return np.ones(count)
    w = np.asarray(weights, dtype=np.float64)
    if w.shape != (count,) or not np.isfinite(w).all() or (w < 0).any() or np.count_nonzero(w) < 3:
        raise PointsError(f"weights are {count} finite numbers, not negative, at least three of them positive")
    return w


def _checked_covariance(covariance: npt.ArrayLike | None, count: int, name: str) -> FloatArray:
    if covariance is None:
        return np.zeros((count, 3, 3))
    c = np.asarray(covariance, dtype=np.float64)
    if c.shape not in ((3, 3), (count, 3, 3)) or not np.isfinite(c).all():
        raise PointsError(f"{name} has shape {c.shape}: give finite (3, 3) or ({count}, 3, 3), in mm^2")
    c = np.broadcast_to(c, (count, 3, 3))
    if np.linalg.eigvalsh(c).min() < 0 or np.abs(c - c.swapaxes(1, 2)).max() > 1e-9 * np.abs(c).max():
        raise PointsError(f"{name} holds a matrix that is not symmetric and positive")
    return c


def _refuse_collinear(points: FloatArray, name: str) -> None:
    """Refuse points on one line: the rotation about it is free, and no residual would show it."""
    centred = points - points.mean(axis=0)
    _, spread, axes = np.linalg.svd(centred, full_matrices=False)
    if spread[1] <= 1e-6 * spread[0] or spread[0] == 0.0:
        axis = ", ".join(f"{v:.3f}" for v in axes[0])
        raise DegenerateError(
            f"the {name} points lie on one line, so the rotation about the axis ({axis}) is free: "
            "add a point off that line"
        )
