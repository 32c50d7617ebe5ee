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
from picoradar.registration.errors import PointsError
from picoradar.registration.paired_points.checks import checked, checked_covariance, checked_weights, refuse_collinear
from picoradar.registration.paired_points.closed_form import correlation, horn
from picoradar.registration.paired_points.weighted import parameter_covariance, weighted_pose
from picoradar.registration.se3 import displacement_covariance, transform


@dataclass(frozen=True)
class PairedPoints:
    """Result of a paired-point registration.

    Attributes
    ----------
    fixed_from_moving : (4, 4) array
        Rigid pose.
    fre_mm : float
        Fiducial registration error, root mean square distance of the pairs after registration, weighted as they were.
        It says nothing about the error at a target; :meth:`tre` does.
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
        return displacement_covariance(self.covariance, np.asarray(target, dtype=np.float64) - self.centre)

    def tre(self, target: npt.ArrayLike) -> FloatArray:
        """Predicted root mean square target registration error (...) mm at `target` (..., 3), fixed frame."""
        variance = np.trace(self.tre_covariance(target), axis1=-2, axis2=-1)
        return np.asarray(np.sqrt(variance), dtype=np.float64)


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
    estimated from the residuals: ``<FLE^2> = <FRE^2> / (1 - 2/N)``. With weights w, the error of a pair is taken to
    have the variance ``s^2 / w``, and ``sum w |r|^2 = s^2 (N - 2)`` (N pairs that count at all) tells s. With
    covariances the weighted sum
    ``sum (b - R a - t)^T Sigma^-1 (b - R a - t)``, ``Sigma = R Sigma_moving R^T + Sigma_fixed``, is minimised.

    Parameters
    ----------
    fixed, moving : (N, 3) arrays
        Paired points, mm, N at least 3 and not on one line.
    weights : (N,) array, optional
        Scalar weights, not together with covariances: inverse variances but for a common factor. A pair of weight 0
        takes no part; its residual is reported.
    fixed_covariance, moving_covariance : (3, 3) or (N, 3, 3) arrays, optional
        Localisation covariance in each frame, mm^2.

    Raises
    ------
    PointsError
        For arrays of wrong shape, with NaN or infinite values, or with fewer than three pairs.
    DegenerateError
        For points that are collinear (the free axis is named), those of weight 0 left out.

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
    b, a = checked(fixed, "fixed"), checked(moving, "moving")
    if a.shape != b.shape:
        raise PointsError(f"paired points come in pairs: {len(b)} fixed and {len(a)} moving points were given")
    w = checked_weights(weights, len(b))
    counts = w > 0
    for name, points in (("fixed", b), ("moving", a)):
        refuse_collinear(points[counts], name)
    centre = b.mean(axis=0)
    has_covariance = fixed_covariance is not None or moving_covariance is not None
    if has_covariance and weights is not None:
        raise PointsError("give either scalar weights or covariances, not both")
    start = horn(b, a, w)
    if has_covariance:
        sigma_b = checked_covariance(fixed_covariance, len(b), "fixed_covariance")
        sigma_a = checked_covariance(moving_covariance, len(b), "moving_covariance")
        solution, covariance = weighted_pose(b, a, sigma_b, sigma_a, start)
    else:
        solution = start
        residuals = b - transform(start, a)
        used = int(counts.sum())
        unit_variance = float(w @ (residuals**2).sum(axis=1)) / (used - 2) / 3.0  # of one axis, at weight 1
        sigma = np.eye(3) * (unit_variance / w[counts])[:, None, None]
        covariance = parameter_covariance(transform(start, a[counts]), centre, sigma, w[counts])
    residuals = b - transform(solution, a)
    return PairedPoints(
        fixed_from_moving=solution,
        fre_mm=float(np.sqrt(np.average((residuals**2).sum(axis=1), weights=w))),
        residuals_mm=residuals,
        covariance=covariance,
        centre=centre,
        uniqueness_gap=_uniqueness_gap(correlation(b, a, w)[2]),
    )


def _uniqueness_gap(s: FloatArray) -> float:
    """``(d2 + sign * d3) / d1`` of the singular values of a correlation matrix (3, 3)."""
    u, d, vt = np.linalg.svd(s)
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return float((d[1] + sign * d[2]) / d[0])
