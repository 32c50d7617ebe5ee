"""The dissertation's time-significant point (section 2.5): 50 % of the pulse's own peak on the leading edge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import ShotNoise
from picoradar.instrument.ranging.pair import PulsePair
from picoradar.instrument.ranging.pulses import CoarseTraces, Pulses
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import excess_variance

FloatArray = NDArray[np.float64]

# Variance of the last of several crossings over that of a single one, against the rise of the edge from one sample to
# the next in standard deviations of the noise: a straight edge with independent normal noise and the
# samples anywhere on it, 400 000 times each (tests/instrument/test_ranging.py does it again).
LAST_CROSSING = np.array(
    [
        [0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0],
        [0.522, 0.570, 0.641, 0.695, 0.739, 0.775, 0.832, 0.871, 0.911, 0.937, 0.967, 0.987, 1.0],
    ]
)


LEAST_HALF = 3  # samples to either side: a cubic through fewer is no smoother than a straight line between two
NEWTON_STEPS = 3  # of a cubic that is nearly straight: the third one moves it by 1e-6 of a step


@dataclass(frozen=True)
class Edges:
    """Time-significant point and amplitude of one pulse in each of R records; NaN where there is no crossing.

    Attributes
    ----------
    time_ps, time_variance_ps2 : (R,) float arrays
        Crossing, and its variance without that of the baseline.
    height_mv, height_variance_mv2 : (R,) float arrays
        Peak above the baseline.
    covariance_ps_mv : (R,) float array
        Covariance of time and height.
    baseline_ps_per_mv : (R,) float array
        How far an error of the baseline moves the crossing.
    """

    time_ps: FloatArray
    time_variance_ps2: FloatArray
    height_mv: FloatArray
    height_variance_mv2: FloatArray
    covariance_ps_mv: FloatArray
    baseline_ps_per_mv: FloatArray


class ExternalReference(Edges):
    """Instants from elsewhere, not pulses of the trace: exact, without amplitude."""


def external_reference(time_ps: FloatArray) -> ExternalReference:
    """Return references (R,) whose instants come from elsewhere: no amplitude, and no error."""
    zero, unknown = np.zeros_like(time_ps), np.full_like(time_ps, np.nan)
    return ExternalReference(time_ps, zero, unknown, unknown, unknown, zero)


def half_maximum(
    traces_mv: FloatArray,
    times_ps: FloatArray,
    coarse: CoarseTraces,
    pulses: Pulses,
    noise: ShotNoise,
    sweeps: FloatArray,
    settings: RangingSettings,
) -> Edges:
    """Find where each pulse crosses half of its own peak, walking back from the peak to the first sample below.

    The peak is the vertex of a parabola through the samples about it: the largest sample alone would be too high by
    one to two standard deviations of the noise. The crossing is interpolated linearly between two samples v0 < L <= v1
    at the level L = (baseline + peak) / 2, f = (L - v0) / (v1 - v0). With the slope s' of a cubic through the samples
    about it, its variance is ``(q [(1 - f)^2 + f^2] var(v) + var(peak) / 4) / s'^2``. Where the edge rises by less than
    two standard deviations of the noise from one sample to the next, there are several crossings; the last one is
    taken, which comes late, and scatters less than a single one would: by the factor q (`LAST_CROSSING`).

    Parameters
    ----------
    traces_mv : (R, S) float array
    times_ps : (S,) float array
    coarse, pulses
        Where the pulses are.
    noise : ShotNoise
        Noise on a pulse beyond that of the trace between the pulses.
    sweeps : (R,) float array
        Sweeps averaged in each trace.
    settings : RangingSettings
    """
    step_ps = float(times_ps[1] - times_ps[0])
    centre = pulses.peak * coarse.width + coarse.width // 2
    peak_mv, shape = _peak(traces_mv, centre, settings.peak_half_width_ps / step_ps)
    height = peak_mv - coarse.baseline_mv
    level = (peak_mv + coarse.baseline_mv) / 2

    found = pulses.found & (height > 0)
    low, share, crossed = _crossing(traces_mv, centre, level, found, round(settings.edge_reach_ps / step_ps))
    slope = _slope(traces_mv, low, step_ps, settings.slope_half_width_ps / step_ps)
    own_share = (1 - share) ** 2 + share**2  # of a sample's variance, that the crossing has
    half = round(settings.crossing_half_width_ps / step_ps)
    if smooth := half >= LEAST_HALF:
        share, own_share = _smooth_crossing(traces_mv, low, share, level, half)
    crossed &= slope > 0
    slope = np.where(crossed, slope, np.nan)

    def variance(signal_mv: FloatArray, slope_mv_per_ps: FloatArray | float) -> FloatArray:
        excess = excess_variance(noise, signal_mv, slope_mv_per_ps)
        return np.asarray(coarse.noise_mv**2 + excess / sweeps, dtype=np.float64)

    height_variance = shape * variance(height, 0.0)
    sample_variance = variance(height / 2, slope)
    with np.errstate(divide="ignore"):  # a trace without noise has one crossing
        crowded = 1.0 if smooth else np.interp(slope * step_ps / np.sqrt(sample_variance), *LAST_CROSSING)
    edge_variance = crowded * own_share * sample_variance
    return Edges(
        time_ps=np.where(crossed, times_ps[low] + share * step_ps, np.nan),
        time_variance_ps2=(edge_variance + height_variance / 4) / slope**2,
        height_mv=np.where(crossed, height, np.nan),
        height_variance_mv2=height_variance + coarse.baseline_variance_mv2,
        covariance_ps_mv=(height_variance - coarse.baseline_variance_mv2) / (2 * slope),
        baseline_ps_per_mv=0.5 / slope,
    )


def join(start: Edges, stop: Edges, coarse: CoarseTraces) -> PulsePair:
    """Make a pair of two edges; both stand on the same baseline, whose error moves them in the same direction."""
    common = (stop.baseline_ps_per_mv - start.baseline_ps_per_mv) ** 2 * coarse.baseline_variance_mv2
    return PulsePair(
        reference_ps=start.time_ps,
        reference_mv=start.height_mv,
        reference_variance_ps2=start.time_variance_ps2 + start.baseline_ps_per_mv**2 * coarse.baseline_variance_mv2,
        echo_variance_ps2=stop.time_variance_ps2 + stop.baseline_ps_per_mv**2 * coarse.baseline_variance_mv2,
        interval_ps=stop.time_ps - start.time_ps,
        interval_variance_ps2=start.time_variance_ps2 + stop.time_variance_ps2 + common,
        response_mv=stop.height_mv,
        response_variance_mv2=stop.height_variance_mv2,
        covariance_ps_mv=stop.covariance_ps_mv,
    )


def _crossing(
    traces_mv: FloatArray, centre: NDArray[np.int64], level_mv: FloatArray, found: NDArray[np.bool_], reach: int
) -> tuple[NDArray[np.int64], FloatArray, NDArray[np.bool_]]:
    """Return the last sample below the level before each peak, the crossing behind it as a share of the step, and
    where there is one; no pulse's edge is longer than ``reach`` samples."""
    rows = np.arange(len(traces_mv))
    index = centre[:, None] - np.arange(reach)
    values = np.take_along_axis(traces_mv, np.maximum(index, 0), axis=1)
    below = (values < level_mv[:, None]) & (index >= 0)
    back = np.argmax(below, axis=1)
    crossed = found & below.any(axis=1) & (back > 0)
    low = np.where(crossed, index[rows, back], 0)
    v0, v1 = traces_mv[rows, low], traces_mv[rows, low + 1]
    share = np.divide(level_mv - v0, v1 - v0, out=np.full_like(level_mv, np.nan), where=crossed)
    return low, share, crossed


def _peak(traces_mv: FloatArray, centre: NDArray[np.int64], half_width: float) -> tuple[FloatArray, FloatArray]:
    """Return the vertex of the parabola through the samples about each peak, and its variance for unit noise.

    The pulse is not symmetric about its peak, so where the samples lie about it matters: a second parabola is put
    about the vertex of the first.
    """
    samples = traces_mv.shape[1]
    half = max(2, min(round(half_width), (samples - 1) // 2))  # five samples at least for three unknowns
    offset = np.arange(-half, half + 1)
    solve = np.linalg.pinv(np.vander(offset / half, 3, increasing=True))
    for _ in range(2):
        centre = np.clip(centre, half, samples - half - 1)
        level, tilt, bend = (np.take_along_axis(traces_mv, centre[:, None] + offset, axis=1) @ solve.T).T
        vertex = np.clip(np.divide(-tilt, 2 * bend, out=np.zeros_like(bend), where=bend < 0), -1.0, 1.0)
        centre = centre + np.rint(vertex * half).astype(np.int64)
    powers = np.vander(vertex, 3, increasing=True)
    variance = np.einsum("ri,ij,rj->r", powers, solve @ solve.T, powers)
    return level + tilt * vertex + bend * vertex**2, variance


def _slope(traces_mv: FloatArray, low: NDArray[np.int64], step_ps: float, half_width: float) -> FloatArray:
    """Return the slope (mV/ps) of a cubic through the samples about each crossing."""
    samples = traces_mv.shape[1]
    half = max(2, min(round(half_width), (samples - 1) // 2))
    offset = np.arange(-half, half + 1)
    solve = np.linalg.pinv(np.vander(offset / half, 4, increasing=True))[1]
    centre = np.clip(low, half, samples - half - 1)
    values = np.take_along_axis(traces_mv, centre[:, None] + offset, axis=1)
    return np.asarray(values @ solve / (half * step_ps), dtype=np.float64)


def _smooth_crossing(
    traces_mv: FloatArray, low: NDArray[np.int64], share: FloatArray, level_mv: FloatArray, half: int
) -> tuple[FloatArray, FloatArray]:
    """Return the crossings of a cubic through ``half`` samples to either side, in steps after the sample ``low``, and
    their variances for unit noise and unit slope.

    It is looked for by Newton steps from the crossing of the straight line, within a step of which it stays.
    """
    samples = traces_mv.shape[1]
    half = min(half, (samples - 1) // 2)
    offset = np.arange(-half, half + 1)
    solve = np.linalg.pinv(np.vander(offset, 4, increasing=True).astype(np.float64))
    centre = np.clip(low, half, samples - half - 1)
    cubic = np.take_along_axis(traces_mv, centre[:, None] + offset, axis=1) @ solve.T
    begin = np.nan_to_num(low + share - centre)
    at = begin
    for _ in range(NEWTON_STEPS):
        powers = np.vander(at, 4, increasing=True)
        rate = np.einsum("rk,rk->r", cubic[:, 1:] * [1.0, 2.0, 3.0], powers[:, :3])
        off = level_mv - np.einsum("rk,rk->r", cubic, powers)
        at = begin + np.clip(at - begin + np.divide(off, rate, out=np.zeros_like(off), where=rate > 0), -1.0, 1.0)
    powers = np.vander(at, 4, increasing=True)
    return at + centre - low, np.einsum("ri,ij,rj->r", powers, solve @ solve.T, powers)
