"""What fits of the calibration's pulse leave of the echoes of a target, and the pattern by which one target differs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d

from picoradar.instrument.calibration import Calibration, Stretch
from picoradar.instrument.ranging.ranges import Ranges
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.stretch import stretch_in
from picoradar.instrument.ranging.template import shapes_of, tables
from picoradar.instrument.ranging.template_fit import PulseFit, fit_pulses

FloatArray = NDArray[np.float64]

STEP_PS = 10.0  # of a pattern: a twentieth of the rise time
SMOOTH_PS = 20.0  # standard deviation of the smoothing: nothing of a pulse that rises in 200 ps is narrower
SURE_SIGMAS = 6.0  # by which a pattern must stand out of the noise, as `NoticingSettings.common_sigmas`
DECIMALS = 6  # of a pattern of 0.005 with a noise of 0.0001


class Leftover(NamedTuple):
    """Fits of R echoes, and what they leave, a share of the amplitude: mean (B,) and its variance (B,) in bins of the
    time after the 50 % point (ps)."""

    fit: PulseFit
    after_ps: FloatArray
    mean: FloatArray
    variance: FloatArray


def left_of_echoes(
    traces_mv: FloatArray,
    times_ps: FloatArray,
    ranges: Ranges,
    calibration: Calibration,
    sweeps: ArrayLike,
    settings: RangingSettings | None = None,
) -> Leftover:
    """Fit the echoes of whole traces that have been ranged, and average what the fits leave.

    Parameters
    ----------
    traces_mv : (R, S) float array
    times_ps : (S,) float array
    ranges : Ranges
        Of the R traces, all with a range.
    calibration : Calibration
        With templates and noise.
    sweeps : int or (R,) array
    settings : RangingSettings, optional
    """
    limits = settings or RangingSettings()
    step_ps = float(times_ps[1] - times_ps[0])
    table = tables(shapes_of(calibration), step_ps, limits)[1]
    samples = min(round((limits.piece_lead_ps + limits.piece_trail_ps) / step_ps), len(times_ps))
    first = np.rint((ranges.echo_ps - limits.piece_lead_ps - times_ps[0]) / step_ps).astype(np.int64)
    first = np.clip(first, 0, len(times_ps) - samples)
    pieces = np.take_along_axis(traces_mv, first[:, None] + np.arange(samples), axis=1)
    counts = np.broadcast_to(np.asarray(sweeps, dtype=np.float64), (len(pieces),)).copy()
    fit = fit_pulses(pieces, table, ranges.echo_ps - times_ps[first], ranges.response_mv, counts, limits)
    left = fit.residuals
    if left is None:
        raise ValueError("fits without residuals")
    root = np.sqrt(table.weights(left.entries.first, samples) * counts[:, None])
    share = left.deviations / root / fit.amplitude_mv[:, None]
    after = np.arange(samples) * step_ps - fit.delay_ps[:, None]
    bins = np.rint((after + limits.piece_lead_ps) / STEP_PS).astype(np.int64)
    inside = (bins >= 0) & (bins * STEP_PS <= limits.piece_lead_ps + limits.piece_trail_ps) & left.used
    length = int((limits.piece_lead_ps + limits.piece_trail_ps) / STEP_PS) + 1
    count, total, square = (
        np.bincount(bins[inside], values[inside], minlength=length) for values in (np.ones_like(share), share, share**2)
    )
    mean = total / np.maximum(count, 1.0)
    variance = (square / np.maximum(count, 1.0) - mean**2) / np.maximum(count - 1.0, 1.0)
    variance[count < 2] = np.inf  # nothing is known there
    at_ps = np.asarray(STEP_PS * np.arange(length) - limits.piece_lead_ps, dtype=np.float64)
    return Leftover(fit, at_ps, np.asarray(mean, dtype=np.float64), np.asarray(variance, dtype=np.float64))


def learn_stretch(poses: Sequence[tuple[Leftover, Leftover]]) -> tuple[Stretch, list[FloatArray]] | None:
    """Learn how a material stretches echoes from pairs of targets, without light inside and of the material.

    The pattern is the mean, over the pairs, of what the material's echoes leave more than the other ones.

    Returns
    -------
    Stretch, list of (R,) float arrays
        And the stretch of each of the material's records. None where nothing stands out of the noise.
    """
    variance = np.sum([plain.variance + late.variance for plain, late in poses], axis=0) / len(poses) ** 2
    known = np.isfinite(variance)
    change = np.mean([late.mean - plain.mean for plain, late in poses], axis=0)[known]
    evidence, freedom = float(np.sum(change**2 / variance[known])), int(known.sum())
    if evidence < freedom + SURE_SIGMAS * np.sqrt(2.0 * freedom):
        return None
    weight = 1.0 / variance[known]
    width = SMOOTH_PS / STEP_PS
    smooth = gaussian_filter1d(change * weight, width) / gaussian_filter1d(weight, width)
    share = tuple(np.round(smooth, DECIMALS).tolist())
    start_ps = float(poses[0][0].after_ps[known][0])
    pattern = Stretch(start_ps=start_ps, step_ps=STEP_PS, share=share, sd=0.0)
    settings = RangingSettings()
    found = [stretch_in(late.fit, pattern, settings)[0] for _, late in poses]
    size = float(np.mean([np.average(one.share, weights=1.0 / one.variance) for one in found]))
    pattern = pattern.model_copy(update={"share": tuple(np.round(size * smooth, DECIMALS).tolist())})
    return pattern, [one.share / size for one in found]
