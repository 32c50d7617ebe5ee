"""Quantiles of an error that is not Gaussian: the pose's own minimum, others that may be the truth, and those unseen.

The length of a Gaussian vector squared is ``sum lambda_i chi2_1`` (Fitzpatrick and West, TMI 20:917, 2001). Beside it
stand the other minima that were found, each with its weight, and one wide component for those that were not
(``docs/registration.md``, eq. 12 and 16).

References
----------
Wilson, Hilferty, Proc. Natl. Acad. Sci. 17:684 (1931): the cube root of a chi-square variable is nearly normal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.trust.covariance import P95, quantile_mm

STEPS = 40
"""Halvings in the search for a quantile: a trillionth of the interval."""

FARTHEST_SDS = 10.0
"""No quantile that is reported lies so many standard deviations off."""

TINY_MM = 1e-12
"""A length, or a standard deviation, that stands for none."""

NEGLIGIBLE = 1e-4
"""Other components of less weight in all change no quantile that is reported."""


@dataclass(frozen=True)
class Mixture:
    """An error in three dimensions.

    Attributes
    ----------
    own : (3, 3) array
        Covariance about the pose's own minimum.
    others : sequence of (shift (3,), weight)
        Other minima, of a weight beside the own one's, which is 1; they spread as it does.
    unseen : float
        Probability of a minimum that was not found.
    unseen_sds : float
        Standard deviations of the own one that one of the unseen's stands for.
    """

    own: FloatArray
    others: Sequence[tuple[FloatArray, float]]
    unseen: float
    unseen_sds: float

    def beyond(self, length: float) -> float:
        """Probability that the error is longer."""
        return 1.0 - self._inside(length, _moments(self.own))

    def _inside(self, length: float, moments: tuple[float, float, float]) -> float:
        """Probability that the error is no longer; `moments` are those of the own minimum."""
        total = 1.0 + sum(weight for _, weight in self.others)
        below = _within(length, moments) + sum(
            weight * _beside(length, shift, self.own) for shift, weight in self.others
        )
        return (1.0 - self.unseen) * below / total + self.unseen * _within(length / self.unseen_sds, moments)

    def rms(self) -> float:
        """Root mean square length, without what was not found."""
        total = 1.0 + sum(weight for _, weight in self.others)
        spread = sum(weight * float(shift @ shift) for shift, weight in self.others) / total
        return math.sqrt(max(0.0, float(np.trace(self.own))) + spread)

    def quantile(self, probability: float = P95) -> float:
        """Length that is not exceeded with this probability."""
        if sum(weight for _, weight in self.others) + self.unseen < NEGLIGIBLE:
            return quantile_mm(self.own, probability)
        moments = _moments(self.own)
        farthest = max((float(np.linalg.norm(shift)) for shift, _ in self.others), default=0.0)
        low, high = 0.0, farthest + FARTHEST_SDS * self.unseen_sds * math.sqrt(moments[0])
        for _ in range(STEPS):
            middle = (low + high) / 2.0
            low, high = (middle, high) if self._inside(middle, moments) < probability else (low, middle)
        return high


def _moments(covariance: FloatArray) -> tuple[float, float, float]:
    """Sums of the eigenvalues (3,) and of their squares and cubes, as the cumulants of the squared length."""
    lam = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    return float(lam.sum()), 2.0 * float((lam**2).sum()), 8.0 * float((lam**3).sum())


def _within(length: float, moments: tuple[float, float, float]) -> float:
    """Probability that the vector is no longer: a chi-square distribution of the same three cumulants, see
    :func:`quantile_mm`."""
    k1, k2, k3 = moments
    if k1 <= 0.0:
        return 1.0
    degrees = 8.0 * k2**3 / k3**2
    x = degrees + (length**2 - k1) * math.sqrt(2.0 * degrees / k2)
    if x <= 0.0:
        return 0.0
    part = 2.0 / (9.0 * degrees)
    return _normal(((x / degrees) ** (1.0 / 3.0) - (1.0 - part)) / math.sqrt(part))


def _beside(length: float, shift: FloatArray, own: FloatArray) -> float:
    """Probability that an error about a shift is no longer: by its spread along the shift, to either side."""
    far = float(np.linalg.norm(shift))
    deviation = max(math.sqrt(max(float(shift @ own @ shift), 0.0)) / max(far, TINY_MM), TINY_MM)
    return _normal((length - far) / deviation)


def _normal(z: float) -> float:
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
