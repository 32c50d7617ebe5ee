"""Quantiles of an error with other minima, against draws."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.registration.trust.covariance import quantile_mm
from picoradar.registration.trust.mixture import Mixture

OWN = np.diag([0.04, 0.01, 0.0025])
SHIFT = np.array([1.0, -2.0, 0.5])


def drawn(mixture: Mixture, count: int = 200_000) -> np.ndarray:
    """Lengths of errors (count,) by the mixture's own words."""
    rng = np.random.default_rng(7)
    own = rng.normal(size=(count, 3)) * np.sqrt(np.diag(mixture.own))
    weights = np.array([1.0, *(weight for _, weight in mixture.others)])
    which = rng.choice(len(weights), count, p=weights / weights.sum())
    shifts = np.array([np.zeros(3), *(shift for shift, _ in mixture.others)])[which]
    missed = rng.random(count) < mixture.unseen
    return np.asarray(np.linalg.norm(np.where(missed[:, None], mixture.unseen_sds * own, own + shifts), axis=1))


@pytest.mark.parametrize(
    ("others", "unseen"),
    [
        ([], 0.02),
        ([], 0.2),
        ([(SHIFT, 0.02)], 0.0),
        ([(SHIFT, 0.3)], 0.01),
        ([(SHIFT, 1.0), (-SHIFT / 2.0, 0.1)], 0.05),
    ],
)
def test_quantiles_and_their_reverse(others: list[tuple[np.ndarray, float]], unseen: float) -> None:
    mixture = Mixture(OWN, others, unseen, 8.0)
    lengths = drawn(mixture)
    assert mixture.quantile() == pytest.approx(np.quantile(lengths, 0.95), rel=0.06)
    for length in (0.3, 1.0, 2.5):
        assert mixture.beyond(length) == pytest.approx(np.mean(lengths > length), abs=0.012)
    assert mixture.beyond(mixture.quantile()) == pytest.approx(0.05, abs=1e-6)


def test_alone_it_is_gaussian() -> None:
    assert Mixture(OWN, [], 0.0, 8.0).quantile() == quantile_mm(OWN)
    assert Mixture(OWN, [(SHIFT, 1e-6)], 1e-6, 8.0).quantile() == quantile_mm(OWN)
    assert Mixture(OWN, [], 0.0, 8.0).rms() == pytest.approx(np.sqrt(0.0525))


def test_other_minima_count_in_the_root_mean_square_by_their_weights() -> None:
    expected = np.sqrt(0.0525 + 0.5 / 1.5 * float(SHIFT @ SHIFT))
    assert Mixture(OWN, [(SHIFT, 0.5)], 0.1, 8.0).rms() == pytest.approx(expected)
