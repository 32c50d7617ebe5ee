"""`PulsePair`: what every estimator finds in a record, and the way from there to a range."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, Method
from picoradar.instrument.line import NO_RANGE, Flag
from picoradar.instrument.ranging.ranges import RANGE_PER_INTERVAL_MM_PER_PS, PerRecord, Ranges
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.stretch import Stretched

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
FlagArray = NDArray[np.uint16]


@dataclass(frozen=True)
class PulsePair(PerRecord):
    """Reference and echo of R records; every array is (R,), NaN where a pulse has no time-significant point.

    Attributes
    ----------
    reference_ps, reference_mv : float arrays
        Time-significant point and amplitude of the reference.
    reference_variance_ps2, echo_variance_ps2 : float arrays
        Variances of the two time-significant points by themselves.
    interval_ps, interval_variance_ps2 : float arrays
        From its time-significant point to that of the echo.
    response_mv, response_variance_mv2 : float arrays
        Amplitude of the echo.
    covariance_ps_mv : float array
        Covariance of interval and response.
    """

    reference_ps: FloatArray
    reference_mv: FloatArray
    reference_variance_ps2: FloatArray
    echo_variance_ps2: FloatArray
    interval_ps: FloatArray
    interval_variance_ps2: FloatArray
    response_mv: FloatArray
    response_variance_mv2: FloatArray
    covariance_ps_mv: FloatArray


def share_reference(pair: PulsePair, use: BoolArray, settings: RangingSettings) -> PulsePair:
    """Replace each record's reference by the mean over the records, if their scatter is that of the noise alone.

    The reference stands still over a line: the same fibre, and a delay that drifts with the temperature of the diode.
    Its mean then has ``1 / sum(1 / var)`` instead of ``var``, so that nearly all the variance left is that of the
    echo. When the scatter is greater than noise explains at five standard deviations, every record keeps its own.

    Parameters
    ----------
    pair : PulsePair
    use : (R,) bool array
        Records whose reference is good.
    settings : RangingSettings
    """
    count = int(use.sum())
    if count < settings.min_shared:
        return pair
    weight = np.where(use, 1.0 / pair.reference_variance_ps2, 0.0)
    seen = np.where(use, pair.reference_ps, 0.0)
    mean = float(weight @ seen / weight.sum())
    scatter = float(weight @ (seen - mean) ** 2)
    if scatter > (count - 1) + settings.shared_scatter_sigmas * math.sqrt(2.0 * (count - 1)):
        return pair
    return replace(
        pair,
        reference_ps=np.where(use, mean, pair.reference_ps),
        interval_ps=np.where(use, pair.reference_ps + pair.interval_ps - mean, pair.interval_ps),
        interval_variance_ps2=np.where(use, pair.echo_variance_ps2 + 1.0 / weight.sum(), pair.interval_variance_ps2),
    )


@dataclass(frozen=True)
class Last:
    """The last of two echoes of R records: its pair with the same reference, and the covariance (R, 2, 2) of delay and
    amplitude of the first with those of the last (ps, mV), without the reference; NaN where there is one echo."""

    pair: PulsePair
    between: FloatArray


def to_ranges(
    pair: PulsePair,
    flags: FlagArray,
    method: Method,
    calibration: Calibration | None,
    limits: RangingSettings,
    last: Last | None = None,
) -> Ranges:
    """Turn intervals into ranges: ``c / 2 x Ti + range_zero - walk(response)``, and flag low response, a walk that the
    calibration does not cover, and a reference that is not in its place.

    The noise of the response moves the walk correction with it, so to first order the variance is that of
    ``c / 2 x Ti - w' A`` with w' the slope of the walk.
    """
    mark_misplaced(flags, pair, calibration)
    none = (flags & np.uint16(NO_RANGE)) != 0
    no_reference = (flags & np.uint16(Flag.NO_REFERENCE)) != 0
    response = np.where(none, np.nan, pair.response_mv)
    distance, variance, bias_sd, inside, slope = _corrected(pair, response, method, calibration)
    of_last: dict[str, FloatArray] = {}
    if last is not None:
        last_response = np.where(none, np.nan, last.pair.response_mv)
        last_mm, last_mm2, _, _, last_slope = _corrected(last.pair, last_response, method, calibration)
        scale = RANGE_PER_INTERVAL_MM_PER_PS
        by_first, by_last = (np.stack([np.full_like(w, scale), -w], axis=1) for w in (slope, last_slope))
        of_reference = np.maximum(pair.interval_variance_ps2 - pair.echo_variance_ps2, 0.0)
        together = np.einsum("ri,rij,rj->r", by_first, last.between, by_last) + scale**2 * of_reference
        of_last = {
            "last_range_mm": np.where(none, np.nan, last_mm),
            "last_variance_mm2": np.where(none, np.nan, last_mm2),
            "last_response_mv": last_response,
            "covariance_mm2": np.where(none, np.nan, together),
        }
    with np.errstate(invalid="ignore"):
        weak = (response < limits.low_response_mv) | (pair.echo_variance_ps2 > limits.low_response_sd_ps**2)
        mark(flags, Flag.LOW_RESPONSE, ~none & weak)
    mark(flags, Flag.WALK_EXTRAPOLATED, ~none & ~inside)
    return Ranges(
        range_mm=np.where(none, np.nan, distance),
        variance_mm2=np.where(none, np.nan, variance),
        response_mv=response,
        flags=flags,
        bias_sd_mm=np.where(none, np.nan, bias_sd),
        reference_ps=np.where(no_reference, np.nan, pair.reference_ps),
        reference_mv=np.where(no_reference, np.nan, pair.reference_mv),
        echo_ps=np.where(none, np.nan, pair.reference_ps + pair.interval_ps),
        **of_last,
    )


def with_stretch(ranges: Ranges, found: Stretched | None) -> Ranges:
    """Return ranges with the stretch of their echoes, if it was asked for; where there are two it is not known."""
    if found is None:
        return ranges
    none = (ranges.flags & np.uint16(NO_RANGE | Flag.MIXED | Flag.CLIPPED)) != 0
    share, variance = (np.where(none, np.nan, values) for values in found)
    return replace(ranges, stretch=share, stretch_variance=variance)


def _corrected(
    pair: PulsePair, response_mv: FloatArray, method: Method, calibration: Calibration | None
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray, FloatArray]:
    """Return distance, its variance, the deviation of the walk correction, where the calibration covers it, and the
    slope of the walk (mm / mV)."""
    scale = RANGE_PER_INTERVAL_MM_PER_PS
    variance = scale**2 * pair.interval_variance_ps2
    distance = scale * pair.interval_ps
    none = np.zeros_like(distance)
    if not calibration:
        return distance, variance, none, np.zeros(len(distance), dtype=np.bool_), none
    distance = distance + calibration.range_zero_mm
    if not (walk := calibration.walk.get(method)):
        return distance, variance, none, np.zeros(len(distance), dtype=np.bool_), none
    correction = walk.at(response_mv)
    slope = correction.slope_mm_per_mv
    variance = variance + slope * (slope * pair.response_variance_mv2 - 2 * scale * pair.covariance_ps_mv)
    return distance - correction.error_mm, variance, correction.sd_mm, correction.inside, slope


def mark_misplaced(flags: FlagArray, pair: PulsePair, calibration: Calibration | None) -> None:
    """Flag references that are not where the calibration has them: some other pulse was taken for it."""
    if calibration and calibration.reference_ps:
        earliest, latest = calibration.reference_ps
        with np.errstate(invalid="ignore"):
            mark(flags, Flag.NO_REFERENCE, ~((pair.reference_ps >= earliest) & (pair.reference_ps <= latest)))


def mark(flags: FlagArray, flag: Flag, where: BoolArray) -> None:
    """Set a flag in the records where it holds."""
    flags[where] |= np.uint16(flag)
