"""`ShapeTable`: a pulse and what a fit needs of it, at any place of the sampling grid, by look-up.

A model ``s(t) = A g(t - tau; A)`` whose shape g changes slowly with the amplitude A, sampled every ``step_ps``. For a
ladder of amplitudes and for several places of the 50 % point between two samples, the table holds the signal s, its
derivatives ``d = (ds/dtau, ds/dA, 1) = (-s', g + A dg/dA, 1)``, the inverse variance w of a sample there, and running
sums of the normal equations, so that those of any piece are the difference of two entries. Between the entries the
model of a Gauss-Newton step, linear but for the slope's growth with the amplitude, is exact to 1e-3 of the noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from picoradar.instrument.calibration import ShotNoise
from picoradar.instrument.ranging.settings import RangingSettings

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class Entries(NamedTuple):
    """Entries of the table for R pieces: ``first`` (R,) place in the flat tables, and ``delay_ps`` (R,) from the first
    sample and ``amplitude_mv`` (R,) that they are for."""

    first: IntArray
    delay_ps: FloatArray
    amplitude_mv: FloatArray


class PulseFamily(NamedTuple):
    """Shapes of a pulse: ``shapes`` (K, N) of unit peak, at amplitudes ``response_mv`` (K,) that increase;
    ``start_ps`` is the time of the first value of each against its 50 % point, ``spacing_ps`` that from value to
    value."""

    start_ps: float
    spacing_ps: float
    response_mv: FloatArray
    shapes: FloatArray


class ShapeTable:
    """Look-up of one family of pulse shapes.

    Parameters
    ----------
    family : PulseFamily
    noise : ShotNoise
        Noise of a sample; its floor must be known.
    step_ps : float
        Sampling step of the traces to be fitted.
    settings : RangingSettings

    Attributes
    ----------
    usual_mv : float
        Middle one of the amplitudes.
    """

    def __init__(self, family: PulseFamily, noise: ShotNoise, step_ps: float, settings: RangingSettings) -> None:
        start_ps, spacing_ps, response_mv, shapes = family
        self.step_ps = step_ps
        self._noise = noise
        self.usual_mv = float(response_mv[len(response_mv) // 2])
        lowest, highest = response_mv[0] / settings.table_margin, response_mv[-1] * settings.table_margin
        rungs = int(np.ceil(np.log(highest / lowest) / np.log(settings.rung)))
        self._ladder = np.geomspace(lowest, highest, rungs + 1)
        self._phases = int(np.ceil(step_ps / settings.phase_ps))
        self._before = int(np.ceil(settings.table_reach_ps / step_ps))
        self._length = 2 * self._before
        shift = np.arange(self._phases)[:, None] / self._phases
        time = (np.arange(self._length) - self._before - shift) * step_ps  # (P, N) after the 50 % point
        own = start_ps + spacing_ps * np.arange(shapes.shape[1])
        spline = CubicSpline(own, shapes, axis=1)
        inside = np.clip(time, own[0], own[-1])
        value = np.where(time < own[0], 0.0, spline(inside))  # (K, P, N); behind its end a shape keeps its last value
        rate = np.where((time >= own[0]) & (time <= own[-1]), spline(inside, 1), 0.0)
        level = self._ladder[:, None, None]
        shape, by_level = _between(response_mv, value, self._ladder)
        slope, _ = _between(response_mv, rate, self._ladder)
        signal, slope = level * shape, level * slope
        self._fill(signal.ravel(), -slope.ravel(), (shape + level * by_level).ravel(), noise)

    def _fill(self, signal: FloatArray, by_delay: FloatArray, by_amplitude: FloatArray, noise: ShotNoise) -> None:
        self._signal, self._by_delay, self._by_amplitude = signal, by_delay, by_amplitude
        self._weight = 1.0 / sample_variance(noise, signal, by_delay)
        self._root_weight = np.sqrt(self._weight)
        design = (by_delay, by_amplitude, np.ones_like(signal))
        self._weighted = [self._weight * d for d in design]
        self._normal_sums = _running([self._weighted[i] * design[j] for i, j in PAIRS])
        self._signal_sums = _running([weighted * signal for weighted in self._weighted])

    def locate(self, delay_ps: FloatArray, amplitude_mv: FloatArray, samples: int) -> Entries:
        """Find the entries nearest to pulses whose 50 % points lie ``delay_ps`` (R,) after the first of so many
        samples.

        The delays are held within what the table covers.
        """
        rung = np.rint(self._height(amplitude_mv)).astype(np.int64)
        steps = np.rint(delay_ps / self.step_ps * self._phases).astype(np.int64)
        steps = np.clip(steps, (samples - self._before) * self._phases, self._before * self._phases)
        whole, phase = np.divmod(steps, self._phases)
        first = (rung * self._phases + phase) * self._length + self._before - whole
        placed = np.asarray(steps * (self.step_ps / self._phases), dtype=np.float64)
        return Entries(first, placed, self._ladder[rung])

    def normal_matrix(self, entries: Entries, samples: int) -> FloatArray:
        """Return ``sum w d d^T`` (R, 3, 3) over the samples of each piece."""
        return _matrix(self._normal_sums[entries.first + samples] - self._normal_sums[entries.first])

    def information(self, delay_ps: FloatArray, amplitude_mv: FloatArray, samples: int) -> FloatArray:
        """Return the Fisher information (R, 3, 3) of pieces with pulses of just these amplitudes.

        It lies between the normal matrices of the two neighbouring amplitudes of the table, which differ by a third.
        """
        height = self._height(amplitude_mv)
        low = np.minimum(height.astype(np.int64), len(self._ladder) - 2)
        near = self.locate(delay_ps, self._ladder[low], samples).first
        rung = self._phases * self._length
        lower, upper = (self._normal_sums[at + samples] - self._normal_sums[at] for at in (near, near + rung))
        return _matrix(lower + (height - low)[:, None] * (upper - lower))

    def _height(self, amplitude_mv: FloatArray) -> FloatArray:
        """Return how many rungs up the ladder of amplitudes each one stands, between its ends."""
        lowest, highest = self._ladder[0], self._ladder[-1]
        spacing = np.log(highest / lowest) / (len(self._ladder) - 1)
        return np.asarray(np.log(np.clip(amplitude_mv, lowest, highest) / lowest) / spacing, dtype=np.float64)

    def score(self, entries: Entries, pieces_mv: FloatArray) -> FloatArray:
        """Return ``sum w d (x - s)`` (R, 3) over the samples x (R, M) of each piece."""
        samples = pieces_mv.shape[1]
        modelled = self._signal_sums[entries.first + samples] - self._signal_sums[entries.first]
        seen = [np.einsum("rm,rm->r", _pieces(table, entries.first, samples), pieces_mv) for table in self._weighted]
        score: FloatArray = np.stack(seen, axis=1) - modelled
        return score

    def design(self, first: IntArray, samples: int) -> FloatArray:
        """Return the derivatives (3, R, M) of the samples of pieces by delay, amplitude and baseline."""
        by_delay = _pieces(self._by_delay, first, samples)
        return np.stack([by_delay, _pieces(self._by_amplitude, first, samples), np.ones_like(by_delay)])

    def pulse(self, delay_ps: FloatArray, amplitude_mv: FloatArray, samples: int) -> tuple[FloatArray, FloatArray]:
        """Return the samples (R, M) of pulses, and their derivatives (2, R, M) by delay and amplitude.

        Unlike a piece of the table, it may begin before and end behind what the table covers: there it is zero.
        """
        rung = np.rint(self._height(amplitude_mv)).astype(np.int64)
        steps = np.rint(delay_ps / self.step_ps * self._phases).astype(np.int64)
        whole, phase = np.divmod(steps, self._phases)
        row = (rung * self._phases + phase) * self._length
        column = self._before - whole[:, None] + np.arange(samples)
        index = row[:, None] + np.clip(column, 0, self._length - 1)
        inside = (column >= 0) & (column < self._length)
        by_amplitude = np.where(inside, self._by_amplitude[index], 0.0)
        by_delay = np.where(inside, self._by_delay[index], 0.0)
        off_mv = amplitude_mv - self._ladder[rung]
        off_ps = delay_ps - steps * (self.step_ps / self._phases)
        signal = np.where(inside, self._signal[index], 0.0) + off_mv[:, None] * by_amplitude
        by_delay = by_delay * (amplitude_mv / self._ladder[rung])[:, None]
        return signal + off_ps[:, None] * by_delay, np.stack([by_delay, by_amplitude])

    def variance(self, signal_mv: FloatArray, by_delay: FloatArray) -> FloatArray:
        """Return the variances (mV^2) of samples of a single sweep."""
        return sample_variance(self._noise, signal_mv, by_delay)

    @property
    def phases(self) -> int:
        """Get how many places of the 50 % point between two samples the table has."""
        return self._phases

    def places(self, first: IntArray) -> IntArray:
        """Return where in its piece the pulse of an entry lies (R,), in parts of a sample."""
        row, column = np.divmod(first, self._length)
        return np.asarray((self._before - column) * self._phases + row % self._phases, dtype=np.int64)

    def shifted(self, first: int, samples: int, later_ps: float) -> FloatArray:
        """Return the signal (M,) of a piece whose pulse comes later by whole samples."""
        row = first - first % self._length
        index = np.arange(first, first + samples) - round(later_ps / self.step_ps)
        return np.where(index < row, 0.0, self._signal[np.clip(index, row, row + self._length - 1)])

    def weights(self, first: IntArray, samples: int) -> FloatArray:
        """Return the inverse variances (R, M) of samples of a single sweep."""
        return _pieces(self._weight, first, samples)

    def residual(self, entries: Entries, change: FloatArray, pieces_mv: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the model, moved by ``change`` (R, 3) in delay, amplitude and baseline, leaves of each piece (R,
        M), and the inverse standard deviations (R, M) of a sweep."""
        samples = pieces_mv.shape[1]
        left = pieces_mv - _pieces(self._signal, entries.first, samples)
        left -= change[:, :1] * _pieces(self._by_delay, entries.first, samples)
        left -= change[:, 1:2] * _pieces(self._by_amplitude, entries.first, samples)
        left -= change[:, 2:]
        return left, _pieces(self._root_weight, entries.first, samples)


def sample_variance(noise: ShotNoise, signal_mv: FloatArray, slope_mv_per_ps: FloatArray) -> FloatArray:
    """Return the variance (mV^2) of single samples of a single sweep, with the noise model of the calibration."""
    return np.asarray(noise.floor_mv**2 + excess_variance(noise, signal_mv, slope_mv_per_ps), dtype=np.float64)


def excess_variance(noise: ShotNoise, signal_mv: FloatArray, slope_mv_per_ps: FloatArray | float) -> FloatArray:
    """Return what a pulse adds to the variance (mV^2) of a single sample of a single sweep (docs/ranging.md)."""
    signal = np.maximum(signal_mv, 0.0)
    excess = noise.signal_mv * signal + (noise.signal_share * signal) ** 2 + (noise.jitter_ps * slope_mv_per_ps) ** 2
    return np.asarray(excess, dtype=np.float64)


def _matrix(sums: FloatArray) -> FloatArray:
    matrix = np.empty((len(sums), 3, 3))
    for k, (i, j) in enumerate(PAIRS):
        matrix[:, i, j] = matrix[:, j, i] = sums[:, k]
    return matrix


def _pieces(table: FloatArray, first: IntArray, samples: int) -> FloatArray:
    pieces: FloatArray = sliding_window_view(table, samples)[first]
    return pieces


def _running(columns: list[FloatArray]) -> FloatArray:
    """Return running sums (N + 1, C), beginning with 0."""
    sums = np.zeros((len(columns[0]) + 1, len(columns)))
    for k, column in enumerate(columns):
        np.cumsum(column, out=sums[1:, k])
    return sums


def _between(response_mv: FloatArray, values: FloatArray, ladder: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Interpolate shapes (K, P, N) over log amplitude to the ladder; also return the derivative by amplitude.

    Outside the amplitudes that were learnt the nearest shape is kept.
    """
    level = ladder[:, None, None]
    if len(response_mv) == 1:
        shape = np.broadcast_to(values[0], (len(ladder), *values.shape[1:]))
        return np.asarray(shape), np.zeros_like(level)
    known, rungs = np.log(response_mv), np.log(ladder)
    inside = ((rungs >= known[0]) & (rungs <= known[-1]))[:, None, None]
    curve = PchipInterpolator(known, values, axis=0)
    rungs = np.clip(rungs, known[0], known[-1])
    return curve(rungs), np.where(inside, curve(rungs, 1), 0.0) / level
