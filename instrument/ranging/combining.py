"""Joins the fits of the two pulses of a record, which share one baseline as far as it stands still between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging.pair import PulsePair
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.template_fit import PulseFit

FloatArray = NDArray[np.float64]

NO_KNOWLEDGE = np.eye(3) * 1e12  # covariance (ps^2, mV^2) of what counts for nothing
NOTHING_MV2 = 1e6  # a baseline of more variance than this is not known at all


def unreliable(fit: PulseFit, where: NDArray[np.bool_]) -> PulseFit:
    """Return a fit whose baseline counts for nothing where there is no pulse, so that it does not move the other
    one."""
    covariance = np.where(where[:, None, None], NO_KNOWLEDGE, fit.covariance)
    return fit._replace(baseline_mv=np.where(where, 0.0, fit.baseline_mv), covariance=covariance)


def baselines_apart_mv2(pairs: Sequence[tuple[PulseFit, PulseFit]], settings: RangingSettings) -> float:
    """Return the variance (mV^2) of the difference of the baselines under reference and echo, beyond that of the fits.

    Mains hum and 1/f noise move the baseline from one pulse to the other. The excess of the mean square over its
    expectation is the moment estimator of DerSimonian and Laird (Controlled Clinical Trials 7 (1986) 177); 0 where it
    does not stand out of its own scatter.
    """
    excess, scatter, count = 0.0, 0.0, 0
    for first, second in pairs:
        variance = first.covariance[:, 2, 2] + second.covariance[:, 2, 2]
        known = np.isfinite(variance) & (variance < NOTHING_MV2)
        difference = first.baseline_mv[known] - second.baseline_mv[known]
        excess += float(np.sum(difference**2 - variance[known]))
        scatter += float(np.sum(2.0 * variance[known] ** 2))
        count += int(known.sum())
    if count == 0 or excess < settings.component_sigmas * np.sqrt(scatter):
        return 0.0
    return excess / count


def combine(
    reference: PulseFit,
    echo: PulseFit,
    reference_first_ps: FloatArray,
    echo_first_ps: FloatArray,
    *,
    before: tuple[FloatArray, FloatArray] | None = None,
    apart_mv2: float = 0.0,
) -> PulsePair:
    """Join the fits of two pieces of a trace that share one baseline.

    Each piece tells the baseline under it. They are conditioned on each other: the baselines may differ by a variance
    ``apart_mv2``, and each pulse's delay and amplitude move by ``cov(x, b) / var(b)`` times what that changes. For
    normal errors and a common baseline this is the joint fit of both.

    Parameters
    ----------
    reference, echo : PulseFit
    reference_first_ps, echo_first_ps : (R,) float arrays
        Instants that the delays of the fits count from.
    before : pair of (R,) float arrays, optional
        A third finding of the baseline, and its variance (mV^2).
    apart_mv2 : float
        Variance of the difference of two baselines.
    """
    found = [(reference.baseline_mv, reference.covariance[:, 2, 2]), (echo.baseline_mv, echo.covariance[:, 2, 2])]
    if before is not None:
        found.append(before)
    values, variances = np.stack([value for value, _ in found]), np.stack([variance for _, variance in found])
    known, covariance = _same(values, variances) if apart_mv2 <= 0 else _apart(values, variances, apart_mv2)

    def conditioned(fit: PulseFit, baseline_mv: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return delay and amplitude (R, 2), their covariance with the baseline known, and their share of it."""
        share = fit.covariance[:, :2, 2] / fit.covariance[:, 2, 2][:, None]
        moved = np.column_stack([fit.delay_ps, fit.amplitude_mv]) + share * (baseline_mv - fit.baseline_mv)[:, None]
        own = fit.covariance[:, :2, :2] - share[:, :, None] * fit.covariance[:, None, 2, :2]
        return moved, own, share

    first, first_own, first_share = conditioned(reference, known[0])
    second, second_own, second_share = conditioned(echo, known[1])
    one, other = first_share[:, 0], second_share[:, 0]
    in_first, in_second, between = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]
    return PulsePair(
        reference_ps=reference_first_ps + first[:, 0],
        reference_mv=first[:, 1],
        reference_variance_ps2=first_own[:, 0, 0] + one**2 * in_first,
        echo_variance_ps2=second_own[:, 0, 0] + other**2 * in_second,
        interval_ps=echo_first_ps - reference_first_ps + second[:, 0] - first[:, 0],
        interval_variance_ps2=first_own[:, 0, 0]
        + second_own[:, 0, 0]
        + other**2 * in_second
        + one**2 * in_first
        - 2.0 * one * other * between,
        response_mv=second[:, 1],
        response_variance_mv2=second_own[:, 1, 1] + second_share[:, 1] ** 2 * in_second,
        covariance_ps_mv=second_own[:, 0, 1] + second_share[:, 1] * (other * in_second - one * between),
    )


def _same(values: FloatArray, variances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the common baseline under both pulses (2, R) and its covariance (R, 2, 2)."""
    total = np.sum(1.0 / variances, axis=0)
    common = np.sum(values / variances, axis=0) / total
    return np.stack([common, common]), np.broadcast_to((1.0 / total)[:, None, None], (len(total), 2, 2))


def _apart(values: FloatArray, variances: FloatArray, apart_mv2: float) -> tuple[FloatArray, FloatArray]:
    """Return the baselines under both pulses (2, R), which differ by a variance, and their covariance (R, 2, 2)."""
    count = len(values)
    coupling = (2.0 / apart_mv2) * (np.eye(count) - 1.0 / count)
    precision = np.einsum("kr,kl->rkl", 1.0 / variances, np.eye(count)) + coupling
    covariance = np.linalg.inv(precision)
    known = np.einsum("rkl,lr->kr", covariance, values / variances)
    return known[:2], covariance[:, :2, :2]
