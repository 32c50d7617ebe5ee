"""What lines and patches of points share: errors that many points do not average away.

A common error of a group pulls the pose with all its points at once. The spread of that pull is
``v sum_c S_c S_c^T``, with ``S_c = sum_{i in c} a_i g_i`` over the points of a group c, and v the variance of the error
that each group has for itself (``docs/registration.md``, eq. 10). Groups are the lines of the raster, and cells of the
surface as large as the area over which an error is the same.

References
----------
Liang, Zeger, Biometrika 73:13 (1986): the covariance of estimates from grouped data. Conley, J. Econometrics 92:1
(1999): from spatially correlated data.
"""

from __future__ import annotations

import math

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray, IntArray
from picoradar.registration.settings import TrustSettings


def cells(places: FloatArray, length_mm: float) -> IntArray:
    """Cell (N,) of each of the `places` (N, 3) mm: a cube that holds the area pi length^2 of a surface.

    That is the area over which an error is the same whose correlation is ``exp(-(d / length)^2)``.
    """
    edge = math.sqrt(math.pi) * length_mm
    at = np.floor((places - places.min(axis=0)) / edge).astype(np.int64)
    count = at.max(axis=0) + 1
    return np.asarray((at[:, 0] * count[1] + at[:, 1]) * count[2] + at[:, 2], dtype=np.int64)


def shared_variance(residual: FloatArray, group: IntArray, deviations: float, *, beside: bool = False) -> float:
    """Variance that the residuals (N,) of a group share; 0 unless it is beyond chance by `deviations`.

    The mean product of two residuals of one group.

    Parameters
    ----------
    residual : (N,) array
    group : (N,) array of int
    deviations : float
    beside : bool
        Less the mean product of two residuals of neighbouring groups: of lines, what patches share is in both.
    """
    which = group - int(group.min()) if beside else np.unique(group, return_inverse=True)[1]
    number = np.bincount(which).astype(np.float64)
    total, square = np.bincount(which, residual), np.bincount(which, residual**2)
    pairs = float((number**2 - number).sum())
    if pairs <= 0.0:
        return 0.0
    found = float((total**2 - square).sum()) / pairs
    chance = 2.0 * pairs / pairs**2
    if beside:
        others = float((number[1:] * number[:-1]).sum())
        if others <= 0.0:
            return 0.0
        found -= float((total[1:] * total[:-1]).sum()) / others
        chance += 1.0 / others
    return found if found > deviations * float(np.mean(residual**2)) * math.sqrt(chance) else 0.0


def shared_spread(pulls: FloatArray, group: IntArray) -> FloatArray:
    """Covariance (K, K) of the sum of pulls (N, K) by an error of unit variance that each group has for itself."""
    which = np.unique(group, return_inverse=True)[1]
    sums = np.stack([np.bincount(which, column) for column in pulls.T], axis=1)
    return np.asarray(sums.T @ sums, dtype=np.float64)


def excess_noise(scaled: FloatArray, cosine: FloatArray, used: BoolArray, settings: TrustSettings) -> FloatArray:
    """Factors (N,), 1 or more, by which variances exceed what was reckoned with, in classes of incidence.

    Parameters
    ----------
    scaled : (N,) array
        Residuals over their standard deviations.
    cosine : (N,) array
        Of the angle of incidence.
    used : (N,) array of bool
        Points that count.
    settings : TrustSettings
    """
    edges = np.quantile(cosine[used], np.linspace(0.0, 1.0, settings.incidence_classes + 1)[1:-1])
    which = np.searchsorted(edges, cosine)
    factor = np.ones(len(scaled))
    for number in range(settings.incidence_classes):
        here = which == number
        squares = scaled[here & used] ** 2
        if len(squares) >= settings.min_class_points:
            found = float(squares.mean())
            if found > 1.0 + settings.beyond_chance_sds * np.sqrt(2.0 / len(squares)):
                factor[here] = found
    return factor
