"""Learns `Templates` and `ShotNoise` from repeated records of a target at rest: a bench procedure.

At each of several gray levels the instrument takes records of a target that does not move. Their mean, level by level,
is the pulse shape at that response; their scatter, sample by sample, is the noise. Nothing is assumed of the form of
the pulse.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import nnls
from scipy.signal import savgol_filter

from picoradar.instrument.calibration import ShotNoise, Templates
from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.half_maximum import Edges, half_maximum
from picoradar.instrument.ranging.pulses import coarse_traces, next_pulse
from picoradar.instrument.ranging.settings import LearningSettings, RangingSettings

FloatArray = NDArray[np.float64]


def learn(
    levels: Sequence[FloatArray],
    times_ps: ArrayLike,
    *,
    sweeps: int,
    settings: RangingSettings | None = None,
    learning: LearningSettings | None = None,
) -> tuple[Templates, ShotNoise]:
    """Learn pulse shapes and noise.

    Parameters
    ----------
    levels : sequence of (R, S) float arrays
        For each gray level the mean traces (mV) of at least 20 records, in the order in which they were taken; the
        target is at rest within a level.
    times_ps : (S,) array
        Sampling instants.
    sweeps : int
        Sweeps averaged in each record.
    settings, learning : RangingSettings, LearningSettings, optional
        Thresholds of the search for pulses, and of the learning itself.

    Returns
    -------
    Templates, ShotNoise

    Raises
    ------
    BadInput
        When a level has too few records, no clear echo, or the same response as another.
    """
    times = np.asarray(times_ps, dtype=np.float64)
    limits = settings or RangingSettings()
    own = learning or LearningSettings()
    step_ps = float(times[1] - times[0])
    found = [
        _shapes(np.asarray(level, dtype=np.float64), times, limits, own, number) for number, level in enumerate(levels)
    ]
    if not found:
        raise BadInput("no gray level was given; take records of at least one")
    found.sort(key=lambda shapes: shapes[3])
    responses = np.array([response for *_, response in found])
    if np.any(np.diff(responses) < own.min_level_ratio * responses[1:]):
        raise BadInput(
            f"two gray levels have the same response within {100 * own.min_level_ratio:g} %: "
            f"{np.round(responses, 2).tolist()} mV"
        )
    reference = np.stack([shape for shape, *_ in found]).mean(axis=0)
    templates = Templates(
        start_ps=own.from_ps,
        step_ps=step_ps,
        reference=tuple(np.round(reference, own.decimals).tolist()),
        reference_mv=float(np.mean([height for _, height, *_ in found])),
        response_mv=tuple(responses.tolist()),
        echoes=tuple(tuple(np.round(shape, own.decimals).tolist()) for _, _, shape, _ in found),
    )
    return templates, learn_noise(levels, step_ps, sweeps, own)


def learn_noise(levels: Sequence[FloatArray], step_ps: float, sweeps: int, settings: LearningSettings) -> ShotNoise:
    """Fit the noise model to the scatter of repeated records, sample by sample.

    The variance of a sample is half the mean square of the differences of successive records, so that a slow drift does
    not count, times the sweeps.
    """
    window, degree = smoothing_window(step_ps, settings), settings.smooth_degree
    signals = [savgol_filter(level.mean(axis=0), window, degree) for level in levels]
    slopes = [savgol_filter(level.mean(axis=0), window, degree, deriv=1, delta=step_ps) for level in levels]
    scatter = [np.mean(np.diff(level, axis=0) ** 2, axis=0) / 2 * sweeps for level in levels]
    above = [signal - np.median(signal) for signal in signals]
    return fit_noise(np.concatenate(above), np.concatenate(slopes), np.concatenate(scatter), settings)


def fit_noise(
    signal_mv: FloatArray, slope_mv_per_ps: FloatArray, variance_mv2: FloatArray, settings: LearningSettings
) -> ShotNoise:
    """Fit the noise model to variances (N,) of samples seen at signals and slopes (N,).

    The variance is a sum of non-negative multiples of 1, s, s^2 and s'^2: weighted non-negative least squares, the
    weights from the fit before (the scatter of a variance goes with the variance itself).
    """
    signal = np.maximum(signal_mv, 0.0)
    design = np.column_stack([np.ones_like(signal), signal, signal**2, slope_mv_per_ps**2])
    least = settings.min_variance_mv2
    weight = np.full_like(variance_mv2, 1.0 / max(float(np.mean(variance_mv2)), least))
    for _ in range(settings.noise_rounds):
        solution, _ = nnls(design * weight[:, None], variance_mv2 * weight)
        weight = 1.0 / np.maximum(design @ solution, least)
    floor, shot, share, jitter = solution
    return ShotNoise(
        floor_mv=max(float(np.sqrt(floor)), settings.min_floor_mv),
        signal_mv=float(shot),
        signal_share=min(float(np.sqrt(share)), 1.0),  # noise greater than the pulses: the most that it may be
        jitter_ps=float(np.sqrt(jitter)),
    )


def smoothing_window(step_ps: float, settings: LearningSettings) -> int:
    """Return the odd number of samples over which a trace may be smoothed."""
    return max(settings.min_smooth_samples, 2 * round(settings.smooth_ps / step_ps / 2) + 1)


def _shapes(
    level: FloatArray, times: FloatArray, limits: RangingSettings, own: LearningSettings, number: int
) -> tuple[FloatArray, float, FloatArray, float]:
    """Return shape and height of reference and echo of one level's mean trace."""
    if level.ndim != 2 or level.shape[1] != times.size or len(level) < own.min_records:
        raise BadInput(
            f"gray level {number}: records of shape {level.shape}; "
            f"needs at least {own.min_records} of {times.size} samples"
        )
    step_ps = float(times[1] - times[0])
    mean = level.mean(axis=0, keepdims=True)
    mean = savgol_filter(mean, smoothing_window(step_ps, own), own.smooth_degree, axis=1)
    coarse = coarse_traces(mean, step_ps, limits)
    first = next_pulse(coarse, limits)
    second = next_pulse(coarse, limits, first)
    edges = [half_maximum(mean, times, coarse, pulse, ShotNoise(), np.ones(1), limits) for pulse in (first, second)]
    if any(np.isnan(edge.time_ps[0]) for edge in edges):
        raise BadInput(f"gray level {number}: no clear reference and echo in its mean trace; look at target and beam")
    before, behind = edges[0].time_ps[0] - times[0], times[-1] - edges[1].time_ps[0]
    apart = edges[1].time_ps[0] - edges[0].time_ps[0]
    if before < -own.from_ps or behind < own.to_ps or apart < own.to_ps - own.from_ps:
        raise BadInput(
            f"gray level {number}: the pulses need {-own.from_ps:g} ps before and {own.to_ps:g} ps behind each for "
            f"themselves; "
            f"there are {before:.0f} ps before the reference and {behind:.0f} ps behind the echo"
        )
    spline = CubicSpline(times, mean[0] - coarse.baseline_mv[0])
    (reference, height), (echo, response) = (_shape(spline, edge, step_ps, own) for edge in edges)
    return reference, height, echo, response


def _shape(spline: CubicSpline, edge: Edges, step_ps: float, own: LearningSettings) -> tuple[FloatArray, float]:
    height = float(edge.height_mv[0])
    after = own.from_ps + step_ps * np.arange(int((own.to_ps - own.from_ps) / step_ps))
    return np.asarray(spline(edge.time_ps[0] + after) / height, dtype=np.float64), height
