"""Self-calibrated templates: learnt from the very records that are to be ranged, where there is no calibration."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_coeffs, savgol_filter

from picoradar.instrument.calibration import ShotNoise, Templates
from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.half_maximum import half_maximum
from picoradar.instrument.ranging.learning import fit_noise, smoothing_window
from picoradar.instrument.ranging.padding import with_ends_filled
from picoradar.instrument.ranging.pulses import coarse_traces, next_pulse
from picoradar.instrument.ranging.settings import LearningSettings, RangingSettings

FloatArray = NDArray[np.float64]


def self_calibrate(
    traces_mv: FloatArray,
    times_ps: FloatArray,
    settings: RangingSettings,
    sweeps: FloatArray,
    learning: LearningSettings | None = None,
    *,
    single: bool = False,
) -> tuple[Templates, ShotNoise] | None:
    """Learn the shape of the reference, those of echoes of similar response, and the noise, from records of any target.

    Each record is laid over the others by its half-maximum points, which blurs the shapes by their uncertainty, and of
    few records the shapes keep some noise. So this is second best after a bench procedure (`learn`). The noise is what
    a smoothing polynomial leaves of each trace, sample by sample.

    Parameters
    ----------
    traces_mv : (R, S) float array
    times_ps : (S,) float array
    settings : RangingSettings
    sweeps : (R,) float array
    learning : LearningSettings, optional
    single : bool
        A record holds one pulse, an echo; its mean shape then stands in for that of the reference, which nobody uses.

    Returns
    -------
    Templates and ShotNoise, or None when no record has two clear pulses that stand apart, or the
    sampling is too coarse to show their shape.
    """
    own = learning or LearningSettings()
    chosen = np.unique(np.linspace(0, len(traces_mv) - 1, min(len(traces_mv), own.max_records)).astype(np.int64))
    traces, step_ps = traces_mv[chosen], float(times_ps[1] - times_ps[0])
    coarse = coarse_traces(traces, step_ps, settings)
    first = next_pulse(coarse, settings)
    second = first if single else next_pulse(coarse, settings, first)
    edges = [half_maximum(traces, times_ps, coarse, p, ShotNoise(), sweeps[chosen], settings) for p in (first, second)]
    interval = edges[1].time_ps - edges[0].time_ps
    clear = np.isfinite(interval)
    for pulse, widest in ((first, settings.widest_reference_ps), (second, settings.widest_ps)):
        width = pulse.fwhm_ps(coarse)
        clear &= np.isfinite(width) & (np.nan_to_num(width) > settings.narrowest_ps)
        clear &= np.nan_to_num(width, nan=np.inf) < widest
    # The shapes of clipped pulses are of use where there are no others: such ranges are flagged.
    if (clear & (unclipped := traces.max(axis=1) <= settings.clip_mv[1])).any():
        clear &= unclipped
    room = own.peak_room_ps + step_ps
    if not single:  # an echo in the tail of the reference shows the shape of neither
        clear &= np.nan_to_num(interval) + own.from_ps >= room
    if not clear.any() or step_ps > own.coarsest_ps or own.to_ps < room:
        return None
    reach = own.to_ps if single else min(own.to_ps, float(interval[clear].min()) + own.from_ps)
    lifted = traces - coarse.baseline_mv[:, None]
    height, response = edges[0].height_mv, edges[1].height_mv
    rung = np.floor(np.log(np.where(clear, response, 1.0)) / own.rung_log)
    rungs = [clear & (rung == r) for r in np.unique(rung[clear])]
    templates = Templates(
        start_ps=own.from_ps,
        step_ps=min(step_ps, own.shape_step_ps),
        reference=_shape(lifted[clear], times_ps, edges[0].time_ps[clear], reach, own),
        reference_mv=float(height[clear].mean()),
        response_mv=tuple(float(response[some].mean()) for some in rungs),
        echoes=tuple(_shape(lifted[some], times_ps, edges[1].time_ps[some], reach, own) for some in rungs),
    )
    if own.min_smooth_samples * step_ps > own.smooth_ps + step_ps:  # smoothing would take the pulse for noise
        floor = np.sqrt(np.median(coarse.noise_mv[clear] ** 2 * sweeps[chosen][clear]))
        return templates, ShotNoise(floor_mv=max(float(floor), own.min_floor_mv))
    return templates, _noise(lifted[clear], step_ps, sweeps[chosen][clear], own)


def learn_moving(
    traces: FloatArray,
    times_ps: FloatArray,
    *,
    sweeps: ArrayLike = 1,
    single: bool = False,
    settings: RangingSettings | None = None,
    learning: LearningSettings | None = None,
) -> tuple[Templates, ShotNoise]:
    """Learn pulse shapes and noise from records of targets at any distances, with any responses.

    Each record is aligned by its own crossings, and echoes of similar response share a shape. Second best after
    `learn`, which needs a target at rest.

    Parameters
    ----------
    traces : (R, S) float array
        Traces in mV or counts.
    times_ps : (S,) array
        Sampling instants, evenly spaced.
    sweeps : int or (R,) array
        Sweeps averaged in each trace.
    single : bool
        The records hold one pulse each, as for ``estimate(..., reference_ps=...)``.
    settings, learning : RangingSettings, LearningSettings, optional

    Raises
    ------
    BadInput
        When no record has clear pulses, or the sampling is too coarse.
    """
    values, times = np.asarray(traces, dtype=np.float64), np.asarray(times_ps, dtype=np.float64)
    if values.ndim != 2 or times.ndim != 1 or times.size < 2 or values.shape[1] != times.size:
        raise BadInput(
            f"traces of shape {values.shape} do not fit {times.shape} sampling instants; give one row a record"
        )
    limits = settings or RangingSettings()
    values = with_ends_filled(values, limits.fill_samples)
    finite = np.isfinite(values).all(axis=1)
    if not finite.any():
        raise BadInput("no training record is finite; give traces without NaN")
    counts = np.broadcast_to(np.asarray(sweeps, dtype=np.float64), (len(values),))[finite]
    found = self_calibrate(values[finite], times, limits, counts, learning, single=single)
    if found is None:
        pulses = "a clear echo" if single else "a clear reference and echo that stand apart"
        raise BadInput(
            f"none of {len(values)} training records has {pulses}, or steps of {times[1] - times[0]:g} ps are "
            "too coarse; fit the settings to the pulses (RangingSettings.for_pulse, LearningSettings.for_pulse)"
        )
    return found


def _shape(
    traces: FloatArray, times: FloatArray, edges_ps: FloatArray, reach_ps: float, own: LearningSettings
) -> tuple[float, ...]:
    """Return the mean pulse of unit peak with its 50 % point at 0; in steps shorter than the records' where these are
    long: their pulses lie in different places between two samples."""
    sampled_ps = float(times[1] - times[0])
    step_ps = min(sampled_ps, own.shape_step_ps)
    between = np.interp if sampled_ps <= own.shape_step_ps else _smoothly
    after = own.from_ps + step_ps * np.arange(int((reach_ps - own.from_ps) / step_ps))
    total = np.sum([between(edge + after, times, trace) for edge, trace in zip(edges_ps, traces, strict=True)], axis=0)
    spline = CubicSpline(after, savgol_filter(total, smoothing_window(step_ps, own), own.smooth_degree))
    fine = np.arange(after[0], after[-1], own.fine_ps)
    values = spline(fine)
    top = int(np.argmax(values))
    before = top - int(np.argmax(values[top::-1] < values[top] / 2))
    late = float(np.interp(values[top] / 2, values[before : before + 2], fine[before : before + 2]))
    shape = spline(np.clip(after + late, after[0], after[-1])) / values[top]
    return tuple(np.round(shape, own.decimals).tolist())


def _smoothly(at_ps: FloatArray, times_ps: FloatArray, trace: FloatArray) -> FloatArray:
    """Interpolate as `numpy.interp` does, but by a spline: straight lines would cut the peak off."""
    return np.asarray(CubicSpline(times_ps, trace)(np.clip(at_ps, times_ps[0], times_ps[-1])), dtype=np.float64)


def _noise(traces: FloatArray, step_ps: float, sweeps: FloatArray, own: LearningSettings) -> ShotNoise:
    window, degree = smoothing_window(step_ps, own), own.smooth_degree
    own_share = float(savgol_coeffs(window, degree)[window // 2])  # of a sample in its own smoothed value
    signal = savgol_filter(traces, window, degree, axis=1)
    slope = savgol_filter(traces, window, degree, axis=1, deriv=1, delta=step_ps)
    variance = (traces - signal) ** 2 / (1.0 - own_share) * sweeps[:, None]
    inside = slice(window, -window)
    return fit_noise(signal[:, inside].ravel(), slope[:, inside].ravel(), variance[:, inside].ravel(), own)
