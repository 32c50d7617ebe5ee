"""The family of robust criteria, behind one small interface: residuals in, weights out.

References
----------
Huber (1981). Rousseeuw, Leroy (1987): LMedS and LTS. Chetverikov, Stepanov, Krsek, IVC 23:299 (2005): trimmed ICP.
Yaniv, tutorial on rigid registration, MICCAI (2008): the list of replacements for least squares in ICP.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.scan import SIGMA_PER_MAD, mad_scale

UNKNOWNS = 6
"""Of a rigid pose; they shrink the residuals of small samples."""


class Loss(Protocol):
    """A robust criterion as iteratively reweighted least squares sees it."""

    def weights(self, residuals_mm: FloatArray) -> FloatArray:
        """Weights (N,) of the squared residuals (N,), in [0, 1]."""
        ...


SMALLEST_SCALE_MM = 1e-9
"""Residuals of nil still have a scale to be divided by."""

SMALL_SAMPLE = 5.0
"""Rousseeuw and Leroy's correction of the scale of small samples, 1 + 5 / (N - p)."""


@dataclass(frozen=True)
class MEstimator:
    """An M-estimator: weight ``psi(z)/z`` of residuals in units of ``constant`` times their MAD scale."""

    weight: Callable[[FloatArray], FloatArray]
    constant: float

    def weights(self, residuals_mm: FloatArray) -> FloatArray:
        """Weights (N,) of the squared residuals (N,)."""
        scaled = np.abs(residuals_mm) / (self.constant * _scale(residuals_mm))
        return np.asarray(self.weight(scaled), dtype=np.float64)


@dataclass(frozen=True)
class Trimmed:
    """Least trimmed squares: the `share` of the points with the smallest residuals counts, the rest does not."""

    share: float

    def weights(self, residuals_mm: FloatArray) -> FloatArray:
        """Weights (N,) of the squared residuals (N,), 0 or 1."""
        size = np.abs(residuals_mm)
        kept = max(UNKNOWNS, int(self.share * len(size)))
        last = min(kept, len(size)) - 1
        return np.asarray(size <= np.partition(size, last)[last], dtype=np.float64)


@dataclass(frozen=True)
class LeastMedian:
    """Rejection by the scale of least median of squares: what exceeds `limit` of it does not count."""

    limit: float = 2.5

    def weights(self, residuals_mm: FloatArray) -> FloatArray:
        """Weights (N,) of the squared residuals (N,), 0 or 1."""
        size = np.abs(residuals_mm)
        small_sample = 1.0 + SMALL_SAMPLE / max(1, len(size) - UNKNOWNS)
        scale = SIGMA_PER_MAD * small_sample * float(np.sqrt(np.median(size**2)))
        return np.asarray(size <= self.limit * max(scale, SMALLEST_SCALE_MM), dtype=np.float64)


@dataclass(frozen=True)
class SelfTrimmed:
    """Trimmed ICP that finds its own share: the one that minimises ``e(share) / share^(1 + preference)``.

    Attributes
    ----------
    preference : float
        How strongly large shares are preferred; 2 in the paper of Chetverikov et al.
    min_share : float
        Smallest share that is tried.
    """

    preference: float = 2.0
    min_share: float = 0.3

    def weights(self, residuals_mm: FloatArray) -> FloatArray:
        """Weights (N,) of the squared residuals (N,), 0 or 1."""
        squared = np.sort(residuals_mm**2)
        count = np.arange(1, len(squared) + 1)
        objective = np.cumsum(squared) / count / (count / len(squared)) ** (1.0 + self.preference)
        first = min(len(squared), max(UNKNOWNS, int(self.min_share * len(squared)))) - 1
        limit = squared[first + int(np.argmin(objective[first:]))]
        return np.asarray(residuals_mm**2 <= limit, dtype=np.float64)


@dataclass(frozen=True)
class OneSided:
    """Welsch's weight, narrow in front of the surface and wide behind it: a beam may end early, but not inside bone.

    Attributes
    ----------
    front, behind : float
        Constants for positive (in front) and negative residuals, in units of their MAD scale.
    """

    front: float = 1.5
    behind: float = 6.0

    def weights(self, residuals_mm: FloatArray) -> FloatArray:
        """Weights (N,) of the squared residuals (N,), in [0, 1]."""
        constant = np.where(residuals_mm > 0.0, self.front, self.behind)
        return np.asarray(np.exp(-((residuals_mm / (constant * _scale(residuals_mm))) ** 2)), dtype=np.float64)


def _scale(residuals_mm: FloatArray) -> float:
    """Scale by the median absolute deviation from zero."""
    return max(mad_scale(residuals_mm), SMALLEST_SCALE_MM)


LOSSES: dict[str, Loss] = {
    "least squares": MEstimator(np.ones_like, 1.0),
    "Huber": MEstimator(lambda z: 1.0 / np.maximum(z, 1.0), 1.345),
    "Tukey": MEstimator(lambda z: np.where(z < 1.0, (1.0 - z * z) ** 2, 0.0), 4.685),
    "Cauchy": MEstimator(lambda z: 1.0 / (1.0 + z * z), 2.385),
    "Welsch": MEstimator(lambda z: np.exp(-z * z), 2.985),
    "Geman-McClure": MEstimator(lambda z: 1.0 / (1.0 + z * z) ** 2, 1.0),
    "one-sided": OneSided(),
    "LTS 60 %": Trimmed(0.6),
    "self-trimmed": SelfTrimmed(),
    "LMedS": LeastMedian(),
}
"""By name, with the constants of 95 % efficiency for Gaussian residuals where there are such."""
