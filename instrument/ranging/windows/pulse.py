"""The strongest pulse of each window, found and fitted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template_fit import PulseFit, fit_pulses
from picoradar.instrument.ranging.windows.traces import WindowTraces

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class FoundPulse(NamedTuple):
    """The strongest pulse of each window: its fit, the instant that the fit's delay counts from, by itself and after
    the first sample of the window (``place_ps``), the usable windows, where there is no pulse at all (``missing``), and
    where a long window holds another one (``others``)."""

    fit: PulseFit
    first_ps: FloatArray
    place_ps: FloatArray
    values_mv: FloatArray
    missing: BoolArray
    others: BoolArray


def find_pulse(window: WindowTraces, table: ShapeTable, limits: RangingSettings) -> FoundPulse:
    """Find and fit the strongest pulse of each window (R records)."""
    usable = np.asarray(np.isfinite(window.values_mv).all(axis=1), dtype=np.bool_)
    whole = window.values_mv if usable.all() else np.where(usable[:, None], window.values_mv, 0.0)
    edge, height = _half_way(whole, window.step_ps, limits)
    lead = limits.piece_lead_ps
    samples = min(whole.shape[1], round((lead + limits.piece_trail_ps) / window.step_ps))
    cut = np.clip(edge - round(lead / window.step_ps), 0, whole.shape[1] - samples)
    pieces = whole
    if samples < whole.shape[1]:
        pieces = np.take_along_axis(whole, cut[:, None] + np.arange(samples), axis=1)
    guess = np.asarray((edge - cut) * window.step_ps, dtype=np.float64)
    fit = fit_pulses(pieces, table, guess, height, window.sweeps, limits)
    delay = fit.delay_ps + cut * window.step_ps
    sd = np.sqrt(fit.covariance[:, 1, 1])
    missing = (
        ~usable
        | (fit.amplitude_mv < np.maximum(limits.detection_sigmas * sd, limits.min_response_mv))
        | (delay < limits.window_foot_ps)
        | (delay > (whole.shape[1] - 1) * window.step_ps - limits.window_top_ps)
    )
    others = _others(whole, cut, samples, fit, window.step_ps, limits)
    place = np.asarray(cut * window.step_ps, dtype=np.float64)
    return FoundPulse(fit, window.first_ps + place, place, whole, missing, others)


def _others(
    whole: FloatArray, cut: NDArray[np.int64], samples: int, fit: PulseFit, step_ps: float, limits: RangingSettings
) -> BoolArray:
    """Return where another pulse stands outside the piece that was fitted."""
    width = max(1, round(limits.window_smooth_ps / step_ps))
    if whole.shape[1] < samples + width:
        return np.zeros(len(whole), dtype=np.bool_)
    index = np.arange(whole.shape[1])
    outside = (index < cut[:, None]) | (index >= (cut + samples)[:, None])
    sums = np.cumsum(np.where(outside, whole - fit.baseline_mv[:, None], 0.0), axis=1)
    highest = np.max(sums[:, width:] - sums[:, :-width], axis=1) / width
    noise = limits.detection_sigmas * fit.residual_mv / np.sqrt(width)
    least = np.maximum(limits.min_response_mv, limits.ringing_share * fit.amplitude_mv)
    return np.asarray(highest > np.maximum(noise, least), dtype=np.bool_)


def _half_way(values: FloatArray, step_ps: float, limits: RangingSettings) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the sample nearest to half way up to the highest, and that height, in smoothed traces."""
    width = max(1, min(round(limits.window_smooth_ps / step_ps), values.shape[1] // 4))  # of a short window, a part
    sums = np.cumsum(values, axis=1)
    smooth = (sums[:, width:] - sums[:, :-width]) / width  # of samples 1 .. M - 1
    top = np.argmax(smooth, axis=1)
    index = np.arange(smooth.shape[1])
    high = np.take_along_axis(smooth, top[:, None], axis=1)
    low = np.min(np.where(index <= top[:, None], smooth, np.inf), axis=1, keepdims=True)
    below = (smooth < (high + low) / 2) & (index <= top[:, None])
    last = smooth.shape[1] - 1 - np.argmax(below[:, ::-1], axis=1)
    edge = np.where(below.any(axis=1), last, 0) + 1 + width // 2
    return edge, np.maximum((high - low)[:, 0], limits.start_height_mv)
