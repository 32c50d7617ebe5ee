"""Maximum-likelihood fit of two pulses on one baseline, for records that ask for it."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LEAST_SHARE = 1e-12  # of the greatest information that each unknown has: rounding makes 1e-16 of it
SETTLED_PS = 0.05  # a step that moves a range by less than a hundredth of a millimetre is not worth another one
UNKNOWNS = 5  # delay and amplitude of the first, of the last, baseline


class TwoPulses(NamedTuple):
    """Fits of two pulses to K records.

    Attributes
    ----------
    values : (K, 5) float array
        Delay and amplitude of the first pulse, of the last, and the baseline; delays count from the first sample.
    covariance : (K, 5, 5) float array
        For the sweeps averaged, with the calibrated noise.
    square : (K,) float array
        Sum of the squared residuals over their variances.
    """

    values: FloatArray
    covariance: FloatArray
    square: FloatArray

    def told_apart(self, noise: FloatArray, settings: RangingSettings) -> BoolArray:
        """Return where both pulses stand out of the noise, and apart from each other.

        Parameters
        ----------
        noise : (K,) float array
            Variance of a sample over that of the calibrated noise.
        settings : RangingSettings
        """
        sd = np.sqrt(np.einsum("kii->ki", self.covariance) * noise[:, None])
        delay, amplitude = self.values[:, [0, 2]], self.values[:, [1, 3]]
        least = np.maximum(settings.detection_sigmas * sd[:, [1, 3]], settings.min_response_mv)
        apart = self.covariance[:, 0, 0] + self.covariance[:, 2, 2] - 2.0 * self.covariance[:, 0, 2]
        far = delay[:, 1] - delay[:, 0] > settings.apart_sigmas * np.sqrt(apart * noise)
        return np.asarray((amplitude > least).all(axis=1) & far, dtype=np.bool_)


def fit_two_pulses(
    pieces_mv: FloatArray,
    table: ShapeTable,
    delay_ps: FloatArray,
    amplitude_mv: FloatArray,
    sweeps: FloatArray,
    settings: RangingSettings,
) -> TwoPulses:
    """Fit two pulses where one has been fitted.

    The best of a few pairs of places about the single pulse, with amplitudes and baseline by linear least squares, is
    where the Gauss-Newton steps begin.

    Parameters
    ----------
    pieces_mv : (K, M) float array
    table : ShapeTable
    delay_ps, amplitude_mv : (K,) float arrays
        Of the single pulse.
    sweeps : (K,) float array
    settings : RangingSettings
    """
    values = _start(pieces_mv, table, delay_ps, amplitude_mv, sweeps, settings)
    best: TwoPulses | None = None
    move = np.full(UNKNOWNS, np.inf)
    move[[0, 2]] = settings.max_move_ps
    samples = pieces_mv.shape[1]
    for _ in range(settings.two_pulse_steps):
        left, design, weight = _model(pieces_mv, table, values, sweeps)
        normal = _solvable(np.einsum("ukm,vkm,km->kuv", design, design, weight), settings)
        square = np.einsum("km,km->k", left**2, weight)
        covariance = np.linalg.inv(normal)
        now = TwoPulses(values, np.asarray(covariance, dtype=np.float64), square)
        best = now if best is None else _better(best, now)
        step = np.einsum("kuv,vkm,km->ku", covariance, design, weight * left)
        values = values + np.clip(step, -move, move)
        values[:, [1, 3]] = np.clip(values[:, [1, 3]], settings.min_response_mv / 4, None)
        values[:, [0, 2]] = np.clip(values[:, [0, 2]], -samples * table.step_ps, 2 * samples * table.step_ps)
        if np.abs(step[:, [0, 2]]).max() < SETTLED_PS:
            break
    if best is None:
        raise AssertionError("no step was taken")
    return _in_order(best)


def _solvable(normal: FloatArray, settings: RangingSettings) -> FloatArray:
    """Return normal matrices (..., U, U) that can be inverted, also where two pulses are the same."""
    unknowns = normal.shape[-1]
    diagonal = np.einsum("...uu->...u", normal)
    ridge = LEAST_SHARE * diagonal.max(axis=-1, keepdims=True) + 1.0 / settings.prior_sd**2
    return np.asarray(normal + ridge[..., None] * np.eye(unknowns), dtype=np.float64)


def _better(one: TwoPulses, other: TwoPulses) -> TwoPulses:
    """Take of each record the fit that leaves less."""
    less = other.square < one.square
    return TwoPulses(
        np.where(less[:, None], other.values, one.values),
        np.where(less[:, None, None], other.covariance, one.covariance),
        np.where(less, other.square, one.square),
    )


def _in_order(fit: TwoPulses) -> TwoPulses:
    """Put the earlier pulse first."""
    swap = fit.values[:, 0] > fit.values[:, 2]
    order = np.where(swap[:, None], [2, 3, 0, 1, 4], np.arange(UNKNOWNS))
    values = np.take_along_axis(fit.values, order, axis=1)
    rows = np.take_along_axis(fit.covariance, order[:, :, None], axis=1)
    return TwoPulses(values, np.take_along_axis(rows, order[:, None, :], axis=2), fit.square)


def _model(
    pieces: FloatArray, table: ShapeTable, values: FloatArray, sweeps: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what the model leaves (K, M), its derivatives (5, K, M), and inverse variances (K, M)."""
    samples = pieces.shape[1]
    first, of_first = table.pulse(values[:, 0], values[:, 1], samples)
    last, of_last = table.pulse(values[:, 2], values[:, 3], samples)
    signal, by_delay = first + last, of_first[0] + of_last[0]
    design = np.concatenate([of_first, of_last, np.ones((1, *signal.shape))])
    weight = sweeps[:, None] / table.variance(signal, by_delay)
    return pieces - signal - values[:, 4:], design, weight


def _start(
    pieces: FloatArray,
    table: ShapeTable,
    delay_ps: FloatArray,
    amplitude_mv: FloatArray,
    sweeps: FloatArray,
    settings: RangingSettings,
) -> FloatArray:
    """Return the values (K, 5) of the best pair of places."""
    records, samples = pieces.shape
    single, of_single = table.pulse(delay_ps, amplitude_mv, samples)
    weight = sweeps[:, None] / table.variance(single, of_single[0])
    offsets = np.array(sorted({0.0, *settings.start_offsets_ps, *(-x for x in settings.start_offsets_ps)}))
    shapes = [table.pulse(delay_ps + o, amplitude_mv, samples)[0] / amplitude_mv[:, None] for o in offsets]
    design = np.stack([*shapes, np.ones((records, samples))], axis=1)  # (K, O + 1, M)
    weighted = design * weight[:, None, :]
    normal = weighted @ design.transpose(0, 2, 1)
    seen = np.einsum("kom,km->ko", weighted, pieces)
    pairs = [(i, j, len(offsets)) for i, j in itertools.combinations(range(len(offsets)), 2)]
    chosen = np.array([pair for pair in pairs if offsets[pair[1]] - offsets[pair[0]] >= settings.start_apart_ps])
    of_pairs = _solvable(normal[:, chosen[:, :, None], chosen[:, None, :]], settings)  # (K, P, 3, 3)
    right = seen[:, chosen]
    found = np.linalg.solve(of_pairs, right[..., None])[..., 0]
    explained = np.where((found[..., :2] > 0).all(axis=2), np.einsum("kpu,kpu->kp", found, right), -np.inf)
    best = np.argmax(explained, axis=1)
    rows = np.arange(records)
    at, of_best = offsets[chosen[best, :2]], found[rows, best]
    values = np.column_stack([delay_ps + at[:, 0], of_best[:, 0], delay_ps + at[:, 1], of_best[:, 1], of_best[:, 2]])
    halves = np.column_stack([delay_ps, amplitude_mv / 2, delay_ps + settings.start_apart_ps, amplitude_mv / 2])
    none = np.isinf(explained[rows, best])
    return np.where(none[:, None], np.column_stack([halves, np.zeros(records)]), values)
