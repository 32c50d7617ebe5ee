"""Single samples that belong to no pulse: those of shots that misfired or were lost."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from picoradar.instrument.ranging.settings import RangingSettings

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MEDIAN_OF_SQUARE = 0.4549  # of a standard normal deviate


def outlying(deviations: FloatArray, settings: RangingSettings) -> BoolArray:
    """Find samples that lie far off the fit of their record, each by itself.

    How far samples usually lie is taken from the median over the records and the samples beside, so that more noise
    than was calibrated makes no outliers. Several far samples in a row are another shape, and so are too many of them.

    Parameters
    ----------
    deviations : (R, M) array
        What the fits leave, in standard deviations of the calibrated noise.
    settings : RangingSettings

    Returns
    -------
    (R, M) bool array
    """
    far = np.asarray(deviations**2 > settings.outlier_sigmas**2, dtype=np.bool_)
    some = np.flatnonzero(far.any(axis=1))
    if len(some):
        far[some] = _alone(deviations[some], settings)
    return far


def _alone(deviations: FloatArray, settings: RangingSettings) -> BoolArray:
    samples = deviations.shape[1]
    reach = min(settings.outlier_reach, (samples - 1) // 4)
    beside = np.median(_around(deviations, reach), axis=2)  # a fit that outliers have pulled off is off smoothly
    squares = (deviations - beside) ** 2
    far = squares > settings.outlier_sigmas**2 * np.maximum(_usual_square(squares, settings.min_usual_samples), 1.0)
    longest = max(settings.longest_outlier_run, round(settings.longest_outlier_share * samples))
    many = far.sum(axis=1) > max(settings.max_outliers, settings.max_outlier_share * samples)
    if samples > longest:
        many |= np.all(sliding_window_view(far, longest + 1, axis=1), axis=2).any(axis=1)
    return np.asarray(far & ~many[:, None], dtype=np.bool_)


def _around(values: FloatArray, reach: int) -> FloatArray:
    """Return each value with so many to either side (R, M, 2 reach + 1)."""
    padded = np.pad(values, ((0, 0), (reach, reach)), mode="reflect")
    return sliding_window_view(padded, 2 * reach + 1, axis=1)


def _usual_square(squares: FloatArray, at_least: int) -> FloatArray:
    """Return what the square of a deviation usually is at each sample (M,), from its median over so many and more."""
    records, samples = squares.shape
    reach = min(-(-at_least // (2 * records)), (samples - 1) // 2)
    around = _around(squares, reach)
    middle = np.median(around.transpose(1, 0, 2).reshape(samples, -1), axis=1)
    return np.asarray(middle / MEDIAN_OF_SQUARE, dtype=np.float64)
