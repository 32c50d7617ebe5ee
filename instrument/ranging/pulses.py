"""Finds the pulses of traces: in bins of a quarter of the rise time, all records at once.

A pulse begins where the coarse trace has risen by a significant step above its lowest value since the end of the
pulse before, and ends where it has fallen to half of its own peak. So two pulses that overlap are still told apart as
long as there is a dip between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging.settings import RangingSettings

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class CoarseTraces:
    """Traces (R, S) in bins: (R, B) means with the baseline taken off.

    Attributes
    ----------
    values_mv : (R, B) float array
    width : int
        Samples in a bin.
    bin_ps : float
    baseline_mv, baseline_variance_mv2 : (R,) float arrays
    noise_mv : (R,) float array
        Standard deviation of a sample between the pulses.
    step_mv : (R,) float array
        Smallest significant rise.
    """

    values_mv: FloatArray
    width: int
    bin_ps: float
    baseline_mv: FloatArray
    baseline_variance_mv2: FloatArray
    noise_mv: FloatArray
    step_mv: FloatArray


@dataclass(frozen=True)
class Pulses:
    """One pulse in each of R records; indices count bins and mean nothing where ``found`` is false.

    Attributes
    ----------
    found : (R,) bool array
    rise, peak, end : (R,) int arrays
        Where the rise became significant, the peak, and the first bin below half of it (B when there is none).
    height_mv, valley_mv : (R,) float arrays
        Coarse height of the peak, and lowest value between the last pulse and this one.
    """

    found: BoolArray
    rise: IntArray
    peak: IntArray
    end: IntArray
    height_mv: FloatArray
    valley_mv: FloatArray

    def fwhm_ps(self, coarse: CoarseTraces) -> FloatArray:
        """Get the full width at half maximum (ps), from the coarse trace, good to a third of a bin; NaN if cut off."""
        values, half = coarse.values_mv, self.height_mv / 2
        rows = np.arange(len(values))
        bins = values.shape[1]
        index = np.arange(bins)
        before = (values < half[:, None]) & (index < self.peak[:, None])
        low = bins - 1 - np.argmax(before[:, ::-1], axis=1)  # last bin below half before the peak
        cut = ~before.any(axis=1) | (self.end >= bins) | ~self.found
        low, high = np.minimum(low, bins - 2), np.clip(self.end, 1, bins - 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            lead = low + (half - values[rows, low]) / (values[rows, low + 1] - values[rows, low])
            trail = high - (half - values[rows, high]) / (values[rows, high - 1] - values[rows, high])
            width = (trail - lead) * coarse.bin_ps  # infinite less infinite where two bins of no pulse are the same
        return np.where(cut, np.nan, width)


def coarse_traces(traces_mv: FloatArray, step_ps: float, settings: RangingSettings) -> CoarseTraces:
    """Bin traces (R, S), and find baseline and noise.

    The noise is that of neighbouring samples' differences, over the bins without a pulse: a slow drift does not
    count. The baseline is the mean before the first pulse, or the median of the bins if there is too little before.
    """
    records, samples = traces_mv.shape
    width = max(1, min(round(settings.bin_ps / step_ps), samples // settings.min_bins))
    bins = samples // width
    cut = traces_mv[:, : bins * width]
    of_bin = np.full(width, 1.0 / width)  # a product with it is a mean, in a tenth of the time of one over short rows
    means = cut.reshape(records, bins, width) @ of_bin
    middle = np.median(means, axis=1)
    jumps = np.diff(cut, axis=1)
    jumps *= jumps
    scatter = jumps[:, : (bins - 1) * width].reshape(records, bins - 1, width) @ (of_bin / 2)
    typical = np.median(scatter, axis=1)
    quiet = np.abs(means - middle[:, None]) < _significant(np.sqrt(typical), width, settings)[:, None]
    quiet[:, -1] = False
    if width == 1:  # the only jump of such a bin leads into the next, which may lie on an edge
        quiet[:, :-1] &= np.abs(means[:, 1:] - middle[:, None]) < _significant(np.sqrt(typical), 1, settings)[:, None]
    noise = np.sqrt(np.einsum("rb,rb->r", scatter, quiet[:, :-1]) / np.maximum(quiet.sum(axis=1), 1))
    step = _significant(noise, width, settings)
    values = means - middle[:, None]
    before = np.argmax(values > step[:, None], axis=1) - settings.foot_bins  # without a pulse
    sums = np.cumsum(values, axis=1)
    enough = before >= settings.min_baseline_bins
    shift = np.where(enough, sums[np.arange(records), np.maximum(before, 1) - 1] / np.maximum(before, 1), 0.0)
    values -= shift[:, None]
    used = width * np.where(enough, before, bins * 2 / np.pi)  # a median is worth 2 / pi of its samples
    return CoarseTraces(values, width, width * step_ps, middle + shift, noise**2 / used, noise, step)


def next_pulse(coarse: CoarseTraces, settings: RangingSettings, after: Pulses | None = None) -> Pulses:
    """Find in each record the first pulse, or the first after the end of another one."""
    values = coarse.values_mv
    records, bins = values.shape
    rows, index = np.arange(records), np.arange(bins)
    step = np.broadcast_to(coarse.step_mv[:, None], values.shape)
    searched = values
    start = np.zeros(records, dtype=np.int64)
    if after is not None:
        start = after.end
        searched = np.where(index >= start[:, None], values, np.inf)
        ringing = index < (after.peak + round(settings.ringing_ps / coarse.bin_ps))[:, None]
        step = np.where(ringing, np.maximum(step, settings.ringing_share * after.height_mv[:, None]), step)
    lowest = np.minimum.accumulate(searched, axis=1)
    with np.errstate(invalid="ignore"):
        risen = (searched - lowest > step) & (searched > step)
    risen &= index >= start[:, None]
    if after is None:
        risen |= (values > step) & (index == 0)  # the trace begins inside a pulse
    rise = np.argmax(risen, axis=1)
    found = risen[rows, rise]
    if after is not None:
        found &= after.found
    highest = np.maximum.accumulate(np.where(index >= rise[:, None], values, -np.inf), axis=1)
    fallen = (values < highest / 2) & (index > rise[:, None])
    end = np.where(fallen.any(axis=1), np.argmax(fallen, axis=1), bins)
    peak = np.argmax(np.where((index >= rise[:, None]) & (index < end[:, None]), values, -np.inf), axis=1)
    return Pulses(found, rise, peak, end, values[rows, peak], lowest[rows, rise])


def _significant(noise_mv: FloatArray, width: int, settings: RangingSettings) -> FloatArray:
    step: FloatArray = np.maximum(settings.detection_sigmas * noise_mv / np.sqrt(width), settings.min_response_mv)
    return step
