"""How others find the instants of pulses: the peers of `ranging_peers`, each a short function over one record.

All are given the record's two pulses by the same search (`find_pulses`), and work on a piece about each. Times count
in samples. What a method needs of the pulse's form is learnt from a training set (`Form`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import curve_fit
from scipy.signal import correlate, find_peaks, savgol_filter

FloatArray = NDArray[np.float64]

SMOOTH, DEGREE = 15, 3  # samples (100 ps, half the rise time) and degree of the Savitzky-Golay filter
LEAST_PEAK_MV = 4.0  # eight codes of the A/D
APART = 60  # samples (400 ps): of two peaks nearer than this the smaller one is none
LEAD, TRAIL = 60, 100  # piece about a peak, samples: from before the foot to behind the fall
DELAY, FRACTION = 30, 0.5  # constant fraction: 200 ps, near the rise time, and the usual share
EDGE = 0.25, 0.75  # the part of the edge that a line is put through
GAUSS_LEAD, GAUSS_TRAIL = 100, 100  # samples: shorter pieces do not tell its width from the level it stands on


class Form(NamedTuple):
    """Mean pulse of unit peak against time after its peak (samples), as a function and sampled (LEAD + TRAIL,)."""

    at: CubicSpline
    samples: FloatArray


class Instants(NamedTuple):
    """Instants (samples) of reference and echo, height of the echo (mV), variances of the interval (samples^2) and the
    height (mV^2), and their covariance; NaN where a method states none."""

    reference: float
    echo: float
    height_mv: float
    variance: float = float("nan")
    height_variance: float = float("nan")
    covariance: float = float("nan")


Peer = Callable[[FloatArray, Form], Instants]


def smooth(trace: FloatArray) -> FloatArray:
    """Return a trace (S,) smoothed, and lifted so that its median is 0."""
    return np.asarray(savgol_filter(trace, SMOOTH, DEGREE) - np.median(trace), dtype=np.float64)


def find_pulses(smoothed: FloatArray) -> tuple[int, int]:
    """Return the samples of the first peak, and of the highest one after it."""
    peaks, _ = find_peaks(smoothed, height=LEAST_PEAK_MV, distance=APART)
    if len(peaks) < 2:
        raise ValueError("fewer than two pulses")
    return int(peaks[0]), int(peaks[1 + np.argmax(smoothed[peaks[1:]])])


def piece(trace: FloatArray, peak: int, lead: int = LEAD, trail: int = TRAIL) -> tuple[int, FloatArray]:
    """Return the first sample of a piece about a peak, and the piece."""
    first = max(peak - lead, 0)
    return first, trace[first : peak + trail]


def crossing(values: FloatArray, level: float, before: int) -> float:
    """Return where values last rise through a level before a sample, by a straight line between two samples."""
    below = before - int(np.argmax(values[before::-1] < level))
    return below + (level - values[below]) / (values[below + 1] - values[below])


def vertex(values: FloatArray, top: int) -> float:
    """Return where a parabola through a maximum and its neighbours has its vertex."""
    left, middle, right = values[top - 1 : top + 2]
    return top + 0.5 * (left - right) / (left - 2 * middle + right)


def learn_form(traces: FloatArray) -> Form:
    """Learn the mean echo from records of a target at rest."""
    mean = smooth(traces.mean(axis=0))
    _, peak = find_pulses(mean)
    place = vertex(mean, peak)
    spline = CubicSpline(np.arange(mean.size) - place, mean / mean[peak])
    return Form(spline, np.asarray(spline(np.arange(-LEAD, TRAIL)), dtype=np.float64))


def _each(trace: FloatArray, locate: Callable[[FloatArray, int], float]) -> Instants:
    """Apply a method to the smoothed piece of each pulse."""
    smoothed = smooth(trace)
    found = []
    peaks = find_pulses(smoothed)
    for peak in peaks:
        first, values = piece(smoothed, peak)
        found.append(first + locate(values, peak - first))
    return Instants(found[0], found[1], float(smoothed[peaks[1]]))


def constant_fraction(trace: FloatArray, _: Form) -> Instants:
    """Find where a pulse, delayed, equals a share of itself (Gedcke and McDonald, Nucl. Instrum. Meth. 58 (1968))."""

    def locate(values: FloatArray, peak: int) -> float:
        bipolar = values[:-DELAY] - FRACTION * values[DELAY:]  # negative first, then positive
        lowest = int(np.argmin(bipolar[:peak]))
        return crossing(bipolar, 0.0, lowest + int(np.argmax(bipolar[lowest:])))

    return _each(trace, locate)


def smoothed_half_maximum(trace: FloatArray, _: Form) -> Instants:
    """Find where the smoothed edge crosses half of its peak."""
    return _each(trace, lambda values, peak: crossing(values, values[peak] / 2, peak))


def edge_line(trace: FloatArray, _: Form) -> Instants:
    """Find where a straight line through the middle half of the raw edge crosses half of the peak."""
    smoothed = smooth(trace)
    raw = trace - np.median(trace)
    peaks = find_pulses(smoothed)
    found = []
    for peak in peaks:
        height = smoothed[peak]
        first, last = (round(crossing(smoothed, share * height, peak)) for share in EDGE)
        at = np.arange(first, last + 1)
        slope, start = np.polyfit(at - first, raw[at], 1)
        found.append(first + (height / 2 - start) / slope)
    return Instants(found[0], found[1], float(smoothed[peaks[1]]))


def matched_filter(trace: FloatArray, form: Form) -> Instants:
    """Find the peak of the correlation with the learnt pulse, by a parabola."""
    raw = trace - np.median(trace)
    smoothed = smooth(trace)
    peaks = find_pulses(smoothed)
    score = correlate(raw, form.samples, mode="valid")
    found = []
    for peak in peaks:
        first = max(peak - LEAD - SMOOTH, 1)
        top = first + int(np.argmax(score[first : peak - LEAD + SMOOTH + 1]))
        found.append(vertex(score, top))
    return Instants(found[0], found[1], float(smoothed[peaks[1]]))


def cross_correlation(trace: FloatArray, _: Form) -> Instants:
    """Correlate the echo with the reference of the same record; the peak, by a parabola, is the interval."""
    raw = trace - np.median(trace)
    smoothed = smooth(trace)
    start, stop = find_pulses(smoothed)
    _, reference = piece(raw, start)
    first, echo = piece(raw, stop, LEAD + SMOOTH, TRAIL + SMOOTH)
    score = correlate(echo, reference, mode="valid")
    interval = first + vertex(score, int(np.clip(np.argmax(score), 1, score.size - 2))) - max(start - LEAD, 0)
    return Instants(0.0, interval, float(smoothed[stop]))


def _fitted(
    trace: FloatArray, model: Callable[..., FloatArray], guess: tuple[float, ...], lead: int, trail: int
) -> Instants:
    """Fit a model of each pulse whose first unknowns are place and height; the covariance is that of `curve_fit`."""
    smoothed = smooth(trace)
    raw = trace - np.median(trace)
    places, variance = [], 0.0
    for peak in find_pulses(smoothed):
        first, values = piece(raw, peak, lead, trail)
        at = np.arange(values.size, dtype=np.float64)
        start = (float(peak - first), float(smoothed[peak]), *guess)
        found, covariance = curve_fit(model, at, values, p0=start)
        places.append(first + found[0])
        variance += covariance[0, 0]
    return Instants(places[0], places[1], float(found[1]), float(variance), *map(float, covariance[1, [1, 0]]))


def gaussian_fit(trace: FloatArray, _: Form) -> Instants:
    """Fit a Gaussian on a baseline to each pulse (Wagner and others, ISPRS J. 60 (2006) 100)."""

    def model(at: FloatArray, place: float, height: float, width: float, level: float) -> FloatArray:
        return height * np.exp(-0.5 * ((at - place) / width) ** 2) + level

    return _fitted(trace, model, (38.0, 0.0), GAUSS_LEAD, GAUSS_TRAIL)  # 600 ps / 2.355 are 38 samples


def template_fit(trace: FloatArray, form: Form) -> Instants:
    """Fit the learnt pulse on a baseline to each pulse, all samples alike."""

    def model(at: FloatArray, place: float, height: float, level: float) -> FloatArray:
        return np.asarray(height * form.at(np.clip(at - place, -LEAD - SMOOTH, TRAIL + SMOOTH)) + level)

    return _fitted(trace, model, (0.0,), LEAD, TRAIL)


PEERS: dict[str, Peer] = {
    "constant fraction": constant_fraction,
    "smoothed half maximum": smoothed_half_maximum,
    "edge line": edge_line,
    "matched filter": matched_filter,
    "cross-correlation": cross_correlation,
    "Gaussian fit": gaussian_fit,
    "template, least squares": template_fit,
}
