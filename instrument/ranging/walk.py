"""Timing walk from a gray-target series: a smooth falling curve with its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from picoradar.instrument.calibration import Walk
from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.settings import WalkSettings

FloatArray = NDArray[np.float64]

SD_OF_MAD = 1.4826  # standard deviation of normal errors over their median absolute deviation: 1 / Phi^-1(3/4)


class Means(NamedTuple):
    """Means of the levels (K,), sorted: response (mV), error and standard deviation of the error (mm)."""

    response: FloatArray
    error: FloatArray
    sd: FloatArray


class Priors(NamedTuple):
    """Priors (P, 1, 1) of the walk: scale (mm), length in ln(response), power of the response."""

    scale: FloatArray
    length: FloatArray
    power: FloatArray

    @classmethod
    def of(cls, settings: WalkSettings) -> Priors:
        """Make all of the settings' grid."""
        axes = (
            np.geomspace(*settings.scales_mm),
            np.geomspace(*settings.length_logs),
            np.linspace(*settings.powers),
        )
        return cls(*(grid.reshape(-1, 1, 1) for grid in np.meshgrid(*axes, indexing="ij")))


def fit_walk(levels: Sequence[tuple[FloatArray, FloatArray]], *, settings: WalkSettings | None = None) -> Walk:
    """Fit the range error against the response.

    The walk dies out as the response grows, and its roughness with it. So the curve is an unknown constant and a
    Gaussian process over the logarithm of the response (Matern kernel of order 9/2) times a power of the response.
    The curve and its variance are means over a grid of scales, lengths and powers, each by its marginal likelihood
    (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 2.25-2.30, 2.42 and 5.8): twelve
    levels do not determine these three well enough to take the likeliest for true. The walk falls with the response for
    physical reasons (a stronger pulse crosses earlier), so the curve is then made monotone by weighted isotonic
    regression, and so are curves drawn from the process, which give the standard deviation (Lin and Dunson, Biometrika
    101 (2014) 303).

    The standard deviation is that of the curve: of the mean error of many readings at one response, on a level that
    was not measured, what a level's own readings left uncertain and the interpolation included.

    Parameters
    ----------
    levels : sequence of ((n,) array, (n,) array)
        For each gray level the responses (mV) and range errors (measured without walk correction, minus true; mm) of n
        >= 10 readings. Readings with NaN, and those more than 5 robust standard deviations off their level, are left
        out.
    settings : WalkSettings, optional

    Returns
    -------
    Walk
        With the range of the levels' mean responses as its valid range.

    Raises
    ------
    BadInput
        With fewer than 4 levels, fewer than 10 readings in one, or responses that are not positive and different.
    """
    limits = settings or WalkSettings()
    if len(levels) < limits.min_levels:
        raise BadInput(f"a walk calibration needs at least {limits.min_levels} gray levels, not {len(levels)}")
    kept = sorted(
        (_without_outliers(*level, number, limits) for number, level in enumerate(levels)), key=_mean_response
    )
    slopes = np.zeros(len(kept))
    for _ in range(limits.rounds):
        means = _means(kept, slopes)
        _check(means.response, limits)
        knots = np.geomspace(means.response[0], means.response[-1], limits.knots)
        knots[0], knots[-1] = means.response[0], means.response[-1]
        curve, sd = _falling(*_process(means, knots, limits), limits)
        slopes = np.interp(means.response, knots, np.gradient(curve, knots))
    return Walk(response_mv=tuple(knots.tolist()), error_mm=tuple(curve.tolist()), sd_mm=tuple(sd.tolist()))


def _without_outliers(
    response: FloatArray, error: FloatArray, number: int, limits: WalkSettings
) -> tuple[FloatArray, FloatArray]:
    response, error = np.asarray(response, dtype=np.float64), np.asarray(error, dtype=np.float64)
    keep = np.isfinite(response) & np.isfinite(error)
    if keep.any():
        off = np.abs(error - np.median(error[keep]))
        usual = max(float(np.median(off[keep])), limits.min_deviation_mm)
        keep &= off <= limits.outlier_sigmas * SD_OF_MAD * usual
    if (count := int(keep.sum())) < limits.min_readings:
        raise BadInput(f"gray level {number} has {count} usable readings; take at least {limits.min_readings}")
    return response[keep], error[keep]


def _mean_response(level: tuple[FloatArray, FloatArray]) -> float:
    return float(level[0].mean())


def _means(levels: Sequence[tuple[FloatArray, FloatArray]], slopes: FloatArray) -> Means:
    """Return the levels' means; a response that is off by chance counts as an error of the slope (mm/mV) times that."""
    rows = [
        (response.mean(), error.mean(), np.std(error - slope * response, ddof=1) / np.sqrt(len(error)))
        for (response, error), slope in zip(levels, slopes, strict=True)
    ]
    return Means(*np.array(rows).T)


def _check(response: FloatArray, limits: WalkSettings) -> None:
    if response[0] <= 0:
        raise BadInput(f"a gray level has a response of {response[0]:.3g} mV; take away levels without an echo")
    if np.any(np.diff(response) < limits.min_level_ratio * response[1:]):
        raise BadInput(f"two gray levels have the same response: {np.round(response, 3).tolist()} mV")


def _falling(curve: FloatArray, covariance: FloatArray, limits: WalkSettings) -> tuple[FloatArray, FloatArray]:
    """Return curve and standard deviation (K,) of the process when it must fall: of curves drawn from it, made to."""
    weights = 1.0 / np.diag(covariance)
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    drawn = curve + np.random.default_rng(len(curve)).standard_normal((limits.drawn, len(curve))) @ root.T
    fallen = np.array([isotonic_regression(one, weights=weights, increasing=False).x for one in drawn])
    middle = isotonic_regression(curve, weights=weights, increasing=False).x
    return middle, np.sqrt(np.mean((fallen - middle) ** 2, axis=0))


def _process(means: Means, at: FloatArray, limits: WalkSettings) -> tuple[FloatArray, FloatArray]:
    """Return mean (K,) and covariance (K, K) of the process at some responses, over all priors."""
    x, points = np.log(means.response / limits.reference_mv), np.log(at / limits.reference_mv)
    priors = Priors.of(limits)
    factor = np.linalg.cholesky(_covariance(x, x, priors) + np.diag(means.sd**2))
    both = np.column_stack([np.ones_like(x), means.error])
    ones, errors = np.moveaxis(np.linalg.solve(factor, np.broadcast_to(both, (len(factor), *both.shape))), -1, 0)
    precision = (ones**2).sum(axis=1)
    constant = (ones * errors).sum(axis=1) / precision
    off = errors - constant[:, None] * ones
    half_log_determinant = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1) + 0.5 * np.log(precision)
    evidence = -0.5 * (off**2).sum(axis=1) - half_log_determinant
    weight = np.exp(evidence - evidence.max())
    likely = weight > limits.min_prior_weight
    weight = weight[likely] / weight[likely].sum()
    left = Priors(*(grid[likely] for grid in priors))
    across = np.linalg.solve(factor[likely], _covariance(x, points, left))
    mean = constant[likely, None] + np.einsum("pka,pk->pa", across, off[likely])
    rest = 1.0 - np.einsum("pka,pk->pa", across, ones[likely])  # what the unknown constant adds
    own = _covariance(points, points, left)
    known = np.swapaxes(across, 1, 2) @ across
    of_constant = rest[:, :, None] * rest[:, None, :] / precision[likely, None, None]
    middle = weight @ mean
    apart = (mean - middle) * np.sqrt(weight)[:, None]
    return middle, np.tensordot(weight, own - known + of_constant, 1) + apart.T @ apart


def _covariance(a: FloatArray, b: FloatArray, priors: Priors) -> FloatArray:
    """Return the prior covariances (P, A, B) of the walk at ln(response / ``reference_mv``) for P priors.

    The kernel is that of Matern of order 9/2, d three times the distance over the length.
    """
    scale, length, power = priors
    d = 3.0 * np.abs(a[:, None] - b[None, :]) / length
    size = scale**2 * np.exp(-power * (a[:, None] + b[None, :]))
    return np.asarray(size * (1 + d + 3 * d**2 / 7 + 2 * d**3 / 21 + d**4 / 105) * np.exp(-d), dtype=np.float64)
