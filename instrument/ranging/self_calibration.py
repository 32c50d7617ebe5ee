"""Templates without a calibration: learnt from the very records that are to be ranged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_coeffs, savgol_filter

from picoradar.instrument.calibration import PEAK_ROOM_PS, ShotNoise, Templates
from picoradar.instrument.ranging.half_maximum import half_maximum
from picoradar.instrument.ranging.learning import FROM_PS, PLACES, TO_PS, fit_noise, smoothing_window
from picoradar.instrument.ranging.pulses import coarse_traces, next_pulse
from picoradar.instrument.ranging.settings import RangingSettings

FloatArray = NDArray[np.float64]

MOST_RECORDS = 256
COARSEST_PS = 50.0  # a quarter of the rise time
RUNG_LOG = 0.25  # responses within a quarter share one shape


def learn_unaided(
    traces_mv: FloatArray, times_ps: FloatArray, settings: RangingSettings, sweeps: FloatArray
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

    Returns
    -------
    Templates and ShotNoise, or None when no record has two clear pulses that stand apart, or the
    sampling is too coarse to show their shape.
    """
    chosen = np.unique(np.linspace(0, len(traces_mv) - 1, min(len(traces_mv), MOST_RECORDS)).astype(np.int64))
    traces, step_ps = traces_mv[chosen], float(times_ps[1] - times_ps[0])
    coarse = coarse_traces(traces, step_ps, settings)
    first = next_pulse(coarse, settings)
    second = next_pulse(coarse, settings, first)
    edges = [half_maximum(traces, times_ps, coarse, p, ShotNoise(), sweeps[chosen]) for p in (first, second)]
    interval = edges[1].time_ps - edges[0].time_ps
    clear = np.isfinite(interval)
    for pulse in (first, second):
        width = pulse.fwhm_ps(coarse)
        clear &= np.isfinite(width) & (np.nan_to_num(width) > settings.narrowest_ps)
        clear &= np.nan_to_num(width, nan=np.inf) < settings.widest_ps
    if not clear.any() or step_ps > COARSEST_PS:
        return None
    reach = min(TO_PS, float(interval[clear].min()) + FROM_PS)
    if reach < PEAK_ROOM_PS + step_ps:
        return None
    lifted = traces - coarse.baseline_mv[:, None]
    height, response = edges[0].height_mv, edges[1].height_mv
    rung = np.floor(np.log(np.where(clear, response, 1.0)) / RUNG_LOG)
    rungs = [clear & (rung == r) for r in np.unique(rung[clear])]
    templates = Templates(
        start_ps=FROM_PS,
        step_ps=step_ps,
        reference=_shape(lifted, times_ps, edges[0].time_ps, clear, reach),
        reference_mv=float(height[clear].mean()),
        response_mv=tuple(float(response[some].mean()) for some in rungs),
        echoes=tuple(_shape(lifted, times_ps, edges[1].time_ps, some, reach) for some in rungs),
    )
    return templates, _noise(lifted[clear], step_ps, sweeps[chosen][clear])


def _shape(
    traces: FloatArray, times: FloatArray, edges_ps: FloatArray, chosen: NDArray[np.bool_], reach_ps: float
) -> tuple[float, ...]:
    """Return the mean pulse of unit peak with its 50 % point at 0."""
    step_ps = float(times[1] - times[0])
    place = FROM_PS + step_ps * np.arange(int((reach_ps - FROM_PS) / step_ps))
    total = np.sum(
        [np.interp(edge + place, times, trace) for edge, trace in zip(edges_ps[chosen], traces[chosen], strict=True)],
        axis=0,
    )
    spline = CubicSpline(place, savgol_filter(total, smoothing_window(step_ps), 4))
    fine = np.arange(place[0], place[-1], 0.25)
    values = spline(fine)
    top = int(np.argmax(values))
    before = top - int(np.argmax(values[top::-1] < values[top] / 2))
    late = float(np.interp(values[top] / 2, values[before : before + 2], fine[before : before + 2]))
    shape = spline(np.clip(place + late, place[0], place[-1])) / values[top]
    return tuple(np.round(shape, PLACES).tolist())


def _noise(traces: FloatArray, step_ps: float, sweeps: FloatArray) -> ShotNoise:
    window = smoothing_window(step_ps)
    own_share = float(savgol_coeffs(window, 4)[window // 2])  # of a sample in its own smoothed value
    signal = savgol_filter(traces, window, 4, axis=1)
    slope = savgol_filter(traces, window, 4, axis=1, deriv=1, delta=step_ps)
    variance = (traces - signal) ** 2 / (1.0 - own_share) * sweeps[:, None]
    inside = slice(window, -window)
    return fit_noise(signal[:, inside].ravel(), slope[:, inside].ravel(), variance[:, inside].ravel())
