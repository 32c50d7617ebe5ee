"""What a registration is worth: covariance of the pose, predicted error at targets, weak directions in words.

Notes
-----
All of it comes from one matrix, the information of the point-to-plane residuals
``H = sum w_i g_i g_i^T / sigma_i^2`` with ``g_i = [(p_i - c) x n_i ; n_i]`` about a centre ``c``. Covariance of
point-to-point ICP with re-matching is optimistic by an order of magnitude and is never used.

References
----------
Simon, PhD thesis, CMU (1996). Gelfand et al., 3DIM (2003). Ma, Ellis, Comput. Aided Surg. 9:14 (2004).
Censi, ICRA (2007). Brossard, Bonnabel, Barrau, ICRA (2020).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray, Neighbours
from picoradar.registration.least_squares import weighted_squares
from picoradar.registration.scan import MIN_POINTS, neighbour_sum

P95 = 0.95
"""Probability of the quantiles that are reported."""

MAX_NEWTON_STEPS, SETTLED, SERIES_ROUNDING = 50, 1e-12, 1e-15
"""Of the chi-square quantile: Newton's steps at most, and the relative step and term of a series that are rounding."""


def patch_misfit_mm(residuals_mm: FloatArray, inliers: BoolArray, around: Neighbours, min_neighbours: int) -> float:
    """Root mean square departure of the model from the points that neighbours share, free of the points' own noise.

    Noise differs from point to point, but a wrong bone, a wrong pose or a bad segmentation displaces whole patches: the
    covariance of residuals with the mean of their neighbours' is the variance of that part.

    Parameters
    ----------
    residuals_mm : (N,) array
        Signed distances.
    inliers : (N,) array of bool
        Points that count.
    around : (N, 8) array
        Raster neighbours; N stands for none.
    min_neighbours : int
        Points with fewer inliers beside them tell nothing of what neighbours share.
    """
    count = neighbour_sum(inliers.astype(np.float64), around)
    used = inliers & (count >= min_neighbours)
    if used.sum() < MIN_POINTS:
        return 0.0
    mean = neighbour_sum(np.where(inliers, residuals_mm, 0.0), around)[used] / count[used]
    return float(np.sqrt(max(0.0, float(np.mean(residuals_mm[used] * mean)))))


def inverse_information(information: FloatArray, scale: FloatArray, free_mm: float) -> FloatArray:
    """Inverse of an information matrix (K, K); what nothing holds has the standard deviation `free_mm`.

    Parameters
    ----------
    information : (K, K) array
    scale : (K,) array
        That makes the unknowns comparable: of a turn, one over the points' radius.
    free_mm : float
    """
    both = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(information * both)
    return np.asarray((vectors / np.maximum(values, free_mm**-2)) @ vectors.T * both, dtype=np.float64)


@dataclass(frozen=True)
class Stiffness:
    """Eigenvalues of the information, made dimensionless, and the motions that belong to them.

    Attributes
    ----------
    eigenvalues : (6,) array
        Ascending; of ``H / N`` with lengths in units of `radius_mm` and residuals in units of their sigma.
    motions : (6, 6) array
        Columns: unit motions (rotation, translation / radius) about the centre.
    radius_mm : float
        Root mean square distance of the points from the centre.
    """

    eigenvalues: FloatArray
    motions: FloatArray
    radius_mm: float


def stiffness(rows: FloatArray, sigma_mm: FloatArray, radius_mm: float) -> Stiffness:
    """Eigen-decomposition of the scale-free information (formulas of Simon and Gelfand).

    Parameters
    ----------
    rows : (N, 6) array
        From :func:`plane_rows` about the points' centroid.
    sigma_mm : (N,) array
    radius_mm : float
        Characteristic length L that makes rotations and translations comparable.
    """
    weight = 1.0 / sigma_mm**2
    scale = np.array([1.0 / radius_mm] * 3 + [1.0] * 3)
    values, vectors = np.linalg.eigh(weighted_squares(rows, weight) * np.outer(scale, scale) / weight.sum())
    return Stiffness(np.maximum(values, 0.0), vectors, radius_mm)


@dataclass(frozen=True)
class Target:
    """A point where the error matters, and the error predicted there.

    Attributes
    ----------
    name : str
    position : (3,) array
        Model frame, mm.
    rms_mm, p95_mm : float
        Root mean square and 95 % quantile of the random error; infinite when a motion is free.
    bias_mm : float
        Shift that one standard deviation of what leaves no trace in the residuals causes here (the error budget, root
        of the sum of squares over its entries); NaN when the common range error was never measured.
    stated_mm : float
        The error to reckon with: `p95_mm` and two standard deviations of that shift, added; NaN like it.
    bias_parts_mm : dict of str to float
        The shift by each entry of the budget.
    """

    name: str
    position: FloatArray
    rms_mm: float
    p95_mm: float
    bias_mm: float
    stated_mm: float
    bias_parts_mm: dict[str, float] = field(default_factory=dict)


def quantile_mm(covariance: FloatArray, probability: float = P95) -> float:
    """Quantile of the length of a Gaussian vector with `covariance` (3, 3).

    The squared length is ``sum lambda_i chi2_1`` (Fitzpatrick and West 2001); its quantile by a chi-square distribution
    with the same first three cumulants (Buckley and Eagleson 1988), within about 2 %.
    """
    lam = np.linalg.eigvalsh(covariance)
    k1, k2, k3 = lam.sum(), 2.0 * (lam**2).sum(), 8.0 * (lam**3).sum()
    if k1 <= 0.0:
        return 0.0
    nu = float(8.0 * k2**3 / k3**2)
    x = chi_square_quantile(nu, probability)
    return float(np.sqrt(max(0.0, k1 + (x - nu) * np.sqrt(k2 / (2.0 * nu)))))


def chi_square_quantile(degrees: float, probability: float) -> float:
    """Quantile of a chi-square distribution with any positive degrees of freedom, for probabilities from 0.5 to 0.999.

    Newton's steps on the series of the incomplete gamma function, from the cube-root form of Wilson and Hilferty
    (1931). It stands here because SciPy's takes a sixth of a second to be imported, six registrations' time.
    """
    half = degrees / 2.0
    z = NormalDist().inv_cdf(probability)
    x = half * max(0.1, 1.0 - 1.0 / (9.0 * half) + z / (3.0 * math.sqrt(half))) ** 3
    for _ in range(MAX_NEWTON_STEPS):
        density = math.exp((half - 1.0) * math.log(x) - x - math.lgamma(half))
        term = total = x / half
        n = half
        while term > SERIES_ROUNDING * total:
            n += 1.0
            term *= x / n
            total += term
        move = (density * total - probability) / density
        x = max(x - move, x / 2.0)
        if abs(move) < SETTLED * x:
            break
    return 2.0 * x
