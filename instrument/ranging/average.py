"""Averages over the sweeps of a record, or over repeated ranges, that leave out what went wrong."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.settings import AveragingSettings

FloatArray = NDArray[np.float64]


class AveragedTraces(NamedTuple):
    """Mean traces (R, S) in mV, how many sweeps are in each (R,), and which were left out (R, K)."""

    traces_mv: FloatArray
    sweeps: NDArray[np.int64]
    left_out: NDArray[np.bool_]


class AveragedRanges(NamedTuple):
    """Mean ranges (R,), their variances (R,), how many readings are in each (R,), and which were left out (R, K)."""

    range_mm: FloatArray
    variance_mm2: FloatArray
    readings: NDArray[np.int64]
    left_out: NDArray[np.bool_]


def average_sweeps(sweeps_mv: ArrayLike, *, settings: AveragingSettings | None = None) -> AveragedTraces:
    """Average single sweeps, without those in which laser or trigger failed.

    A sweep is left out when its mean square deviation from the median of the record's sweeps is greater than that of
    most of them by more than noise can make it. Of one or two sweeps none can be judged; more than half must be good.

    Parameters
    ----------
    sweeps_mv : (R, K, S) array
        K sweeps of R records.
    settings : AveragingSettings, optional

    Raises
    ------
    BadInput
        When it has another shape, or no sweep.
    """
    sweeps = np.asarray(sweeps_mv, dtype=np.float64)
    if sweeps.ndim != 3 or 0 in sweeps.shape[1:]:
        raise BadInput(f"sweeps must be (records, sweeps, samples), not of shape {sweeps.shape}")
    records, count, samples = sweeps.shape
    limits = settings or AveragingSettings()
    left_out = np.zeros((records, count), dtype=np.bool_)
    if count >= limits.min_to_judge:
        deviation = np.mean((sweeps - np.median(sweeps, axis=1, keepdims=True)) ** 2, axis=2)
        most = 1.0 + limits.sweep_sigmas * np.sqrt(2.0 / samples)
        left_out = deviation > most * np.median(deviation, axis=1, keepdims=True)
    keep = ~left_out
    used = keep.sum(axis=1)
    return AveragedTraces(np.einsum("rks,rk->rs", sweeps, keep / used[:, None]), used, left_out)


def average_ranges(
    range_mm: ArrayLike, variance_mm2: ArrayLike, *, settings: AveragingSettings | None = None
) -> AveragedRanges:
    """Average repeated readings of the same measurement point, weighted by their variances, without outliers.

    A reading is left out when it is NaN, or, of three and more, off their median by more than 5 standard deviations
    (its own and the median's). A point without any reading has NaN.

    Parameters
    ----------
    range_mm, variance_mm2 : (R, K) arrays
    settings : AveragingSettings, optional

    Raises
    ------
    BadInput
        When the shapes differ or a variance is not positive.
    """
    ranges, variance = np.asarray(range_mm, dtype=np.float64), np.asarray(variance_mm2, dtype=np.float64)
    if ranges.ndim != 2 or ranges.shape != variance.shape or np.any(variance <= 0):
        raise BadInput(
            f"ranges of shape {ranges.shape} and variances of shape {variance.shape} must both be (points, readings), "
            "with positive variances"
        )
    limits = settings or AveragingSettings()
    keep = np.isfinite(ranges) & np.isfinite(variance)
    count = keep.sum(axis=1, keepdims=True)
    ordered = np.sort(np.where(keep, ranges, np.inf), axis=1)
    halves = [np.take_along_axis(ordered, np.maximum(rank, 0), axis=1) for rank in ((count - 1) // 2, count // 2)]
    middle = np.where(count > 0, (halves[0] + halves[1]) / 2, 0.0)
    own = np.where(keep, variance, 1.0)
    of_median = np.pi / 2 * np.where(keep, variance, 0.0).sum(axis=1, keepdims=True) / np.maximum(count, 1) ** 2
    far = (np.where(keep, ranges, 0.0) - middle) ** 2 > limits.outlier_sigmas**2 * (own + of_median)
    keep &= ~(far & (count >= limits.min_to_judge))
    weight = np.where(keep, 1.0 / own, 0.0)
    total = weight.sum(axis=1)
    some = total > 0
    mean = np.divide(
        np.einsum("rk,rk->r", weight, np.where(keep, ranges, 0.0)), total, out=np.full(len(ranges), np.nan), where=some
    )
    spread = np.divide(1.0, total, out=np.full(len(ranges), np.nan), where=some)
    return AveragedRanges(mean, spread, keep.sum(axis=1), ~keep)
