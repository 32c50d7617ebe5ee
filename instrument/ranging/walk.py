"""Timing walk from a gray-target series: a smooth falling curve with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import isotonic_regression

from instrument.calibration import Walk
from instrument.errors import BadInput

FloatArray = NDArray[np.float64]

LEAST_LEVELS, LEAST_READINGS = 4, 10
KNOTS = 97
OUTLIER_SIGMAS = 5.0
LENGTHS = np.geomspace(0.15, 3.0, 24)  # of the kernel, in ln(response)
SCALES_MM = np.geomspace(0.02, 20.0, 24)


def fit_walk(levels: Sequence[tuple[FloatArray, FloatArray]]) -> Walk:
    """Fit the range error against the response.

    A Gaussian process over the logarithm of the response (Matern kernel of order 5/2, constant mean of unknown value;
    length and scale of greatest marginal likelihood; Rasmussen and Williams, Gaussian Processes for Machine Learning,
    2006, eq. 2.25-2.30 and 2.42) gives curve and uncertainty, that of the interpolation between levels included. The
    walk falls with the response for physical reasons (a stronger pulse crosses earlier), so the curve is then
    made monotone by weighted isotonic regression.

    Parameters
    ----------
    levels : sequence of ((n,) array, (n,) array)
        For each gray level the responses (mV) and range errors (measured without walk correction, minus true; mm) of n
        >= 10 readings. Readings with NaN, and those more than 5 robust standard deviations off their level, are left
        out.

    Returns
    -------
    Walk
        With the range of the levels' mean responses as its valid range.

    Raises
    ------
    BadInput
        With fewer than 4 levels, fewer than 10 readings in one, or responses that are not positive and different.
    """
    if len(levels) < LEAST_LEVELS:
        raise BadInput(f"a walk calibration needs at least {LEAST_LEVELS} gray levels, not {len(levels)}")
    means = np.array([_mean(*level, number) for number, level in enumerate(levels)])
    response, error, sd = means[np.argsort(means[:, 0])].T
    if response[0] <= 0:
        raise BadInput(f"a gray level has a response of {response[0]:.3g} mV; take away levels without an echo")
    if np.any(np.diff(response) < 1e-3 * response[1:]):
        raise BadInput(f"two gray levels have the same response: {np.round(response, 3).tolist()} mV")
    knots = np.geomspace(response[0], response[-1], KNOTS)
    knots[0], knots[-1] = response[0], response[-1]
    curve, uncertainty = _process(np.log(response), error, sd, np.log(knots))
    curve = isotonic_regression(curve, weights=1.0 / uncertainty**2, increasing=False).x
    return Walk(response_mv=tuple(knots.tolist()), error_mm=tuple(curve.tolist()), sd_mm=tuple(uncertainty.tolist()))


def _mean(response: FloatArray, error: FloatArray, number: int) -> tuple[float, float, float]:
    """Return mean response, mean error and its standard deviation of one level, without outliers."""
    response, error = np.asarray(response, dtype=np.float64), np.asarray(error, dtype=np.float64)
    keep = np.isfinite(response) & np.isfinite(error)
    if keep.any():
        off = np.abs(error - np.median(error[keep]))
        keep &= off <= OUTLIER_SIGMAS * 1.4826 * max(float(np.median(off[keep])), 1e-9)
    if (count := int(keep.sum())) < LEAST_READINGS:
        raise BadInput(f"gray level {number} has {count} usable readings; take at least {LEAST_READINGS}")
    return float(response[keep].mean()), float(error[keep].mean()), float(error[keep].std(ddof=1) / np.sqrt(count))


def _process(x: FloatArray, y: FloatArray, sd: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return posterior mean and standard deviation of the process at some places."""
    best = max((_evidence(x, y, sd, length, scale), length, scale) for length in LENGTHS for scale in SCALES_MM)
    _, length, scale = best
    factor = cho_factor(_kernel(x, x, length, scale) + np.diag(sd**2))
    ones = np.ones_like(x)
    solved = cho_solve(factor, ones)
    precision = float(ones @ solved)
    level = float(y @ solved) / precision
    across = _kernel(at, x, length, scale)
    mean = level + across @ cho_solve(factor, y - level)
    known = np.einsum("ij,ji->i", across, cho_solve(factor, across.T))
    rest = 1.0 - across @ solved  # what the unknown level adds
    return mean, np.sqrt(np.maximum(scale**2 - known + rest**2 / precision, (0.1 * sd.min()) ** 2))


def _evidence(x: FloatArray, y: FloatArray, sd: FloatArray, length: float, scale: float) -> float:
    """Return the log marginal likelihood, the constant mean integrated out, up to a constant."""
    factor = cho_factor(_kernel(x, x, length, scale) + np.diag(sd**2))
    ones = np.ones_like(x)
    solved = cho_solve(factor, ones)
    precision = float(ones @ solved)
    off = y - float(y @ solved) / precision
    half_log_determinant = float(np.log(np.diag(factor[0])).sum()) + 0.5 * math.log(precision)
    return -0.5 * float(off @ cho_solve(factor, off)) - half_log_determinant


def _kernel(a: FloatArray, b: FloatArray, length: float, scale: float) -> FloatArray:
    distance = np.sqrt(5.0) * np.abs(a[:, None] - b[None, :]) / length
    return np.asarray(scale**2 * (1 + distance + distance**2 / 3) * np.exp(-distance), dtype=np.float64)
