"""What the residuals of fits say about noise that the calibration does not know: its variance components.

A calibration knows the noise of the day on which it was made. Jitter that has grown, an amplifier that has become
noisier, 1/f noise and mains hum leave their mark in the residuals, each in its own way: jitter where the pulse is
steep, 1/f noise and hum in slow waves. Their sizes are the variance components that explain the squares of the
residuals best (least squares of the observed quadratic forms on their expectations, none negative; Rao, J. Multivariate
Analysis 1 (1971) 257). Components that the residuals do not show beyond their own scatter are left out, so that on the
day of the calibration the stated covariance stays what it is: the Cramer-Rao bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from picoradar.instrument.ranging.common_shape import usable_records, usual_gain
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template_fit import UNKNOWNS, PulseFit, Residuals

FloatArray = NDArray[np.float64]

# More white noise, jitter (ps^2), energy (share^2) of a shot, 1/f noise (mV^2), slope of the baseline (mV^2)
WHITE, JITTER, ENERGY, FLICKER, SLOPE = COMPONENTS = range(5)


class _Effects(NamedTuple):
    """What unit components do to a usual record of one sweep.

    Attributes
    ----------
    seen : (Q, C) array
        Expectation of the Q quadratic forms of the residuals.
    calibrated : (Q,) array
        The same for the calibrated noise.
    waves : (Q - M, M) array
        Of the slow waves among the forms.
    added : (C, 3, 3) array
        Covariance of delay, amplitude and baseline.
    amplitude_mv : float
    """

    seen: FloatArray
    calibrated: FloatArray
    waves: FloatArray
    added: FloatArray
    amplitude_mv: float


class ResidualNoise:
    """Noise beyond the calibrated one that the residuals of fits show.

    Parameters
    ----------
    fits : sequence of PulseFit
        Of one radar, taken one shortly after the other. Records of another shape than most do not count.
    settings : RangingSettings
    """

    def __init__(self, fits: Sequence[PulseFit], settings: RangingSettings) -> None:
        self._settings = settings
        groups = [
            (fit, left, _effects_of(left, settings.slow_waves)) for fit in fits if (left := fit.residuals) is not None
        ]
        self._sizes = _sizes(groups, settings)

    @property
    def energy_share(self) -> float:
        """Get by how much the energy of a shot scatters beyond the calibrated noise."""
        return float(np.sqrt(self._sizes[ENERGY]))

    def widen(self, fit: PulseFit) -> PulseFit:
        """Return a fit with the covariance that this noise adds."""
        left = fit.residuals
        if left is None or not self._sizes.any():
            return fit
        effects = _effects_of(left, self._settings.slow_waves)
        relative = np.maximum(fit.amplitude_mv / effects.amplitude_mv, self._settings.min_growth)
        return fit._replace(covariance=fit.covariance + _added(self._sizes, effects, relative, left.sweeps))

    def usual_square(self, fit: PulseFit) -> FloatArray:
        """Return how many times the sum of squares that calibrated noise leaves is usual, for each record (R,)."""
        left = fit.residuals
        if left is None or not self._sizes.any():
            return np.ones(len(fit.delay_ps))
        effects = _effects_of(left, self._settings.slow_waves)
        relative = np.maximum(fit.amplitude_mv / effects.amplitude_mv, self._settings.min_growth)
        samples = left.deviations.shape[1]
        extra = self._sizes * effects.seen[:samples].sum(axis=0) / (samples - UNKNOWNS)
        growth = np.ones((len(relative), len(COMPONENTS)))
        growth[:, JITTER] = growth[:, ENERGY] = relative**2
        growth[:, SLOPE] = left.sweeps
        return np.asarray(1.0 + growth @ extra, dtype=np.float64)

    def deviations_covariance(self, left: Residuals) -> FloatArray:
        """Return the covariance (M, M) of the deviations of a usual record, whole noise and before the fit."""
        samples = left.deviations.shape[1]
        covariance = np.eye(samples)
        if self._sizes.any():
            first, _ = _usual_entry(left)
            root = np.sqrt(left.table.weights(np.array([first]), samples)[0])
            sizes = self._sizes.copy()
            sizes[SLOPE] *= np.median(left.sweeps)
            units = _units(left.table, first, samples)
            covariance += np.einsum("c,cij->ij", sizes, units) * root[:, None] * root
        return covariance


def _effects_of(left: Residuals, waves: int) -> _Effects:
    """Look up what unit components do to the usual record of a group."""
    return _effects(left.table, *_usual_entry(left), left.deviations.shape[1], waves)


def _usual_entry(left: Residuals) -> tuple[int, float]:
    samples = left.deviations.shape[1]
    delay, amplitude = np.array([np.median(left.entries.delay_ps)]), np.array([np.median(left.entries.amplitude_mv)])
    entry = left.table.locate(delay, amplitude, samples)
    return int(entry.first[0]), float(entry.amplitude_mv[0])


@lru_cache(maxsize=64)
def _units(table: ShapeTable, first: int, samples: int) -> FloatArray:
    """Return the covariances (C, M, M) in mV^2 of unit components."""
    at = np.array([first])
    slope, weight = table.design(at, samples)[0, 0], table.weights(at, samples)[0]
    signal = table.shifted(first, samples, 0.0)
    apart = np.abs(np.subtract.outer(np.arange(samples), np.arange(samples)))
    flicker = np.log(samples) - np.log(np.maximum(apart, 0.5))  # of equal power in every octave
    place = np.linspace(-1.0, 1.0, samples)
    white = np.eye(samples) / np.median(weight)
    return np.stack([white, np.diag(slope**2), np.diag(signal**2), flicker, np.outer(place, place)])


@lru_cache(maxsize=256)
def _effects(table: ShapeTable, first: int, amplitude_mv: float, samples: int, waves: int) -> _Effects:
    at = np.array([first])
    design, gain = usual_gain(table, first, samples)
    weight = table.weights(at, samples)[0]
    root = np.sqrt(weight)
    rest = (np.eye(samples) - design.T @ gain) * root[:, None]  # deviations that a change in mV leaves
    place = np.linspace(-1.0, 1.0, samples)
    slow = np.linalg.qr(np.polynomial.legendre.legvander(place, waves))[0][:, 1:].T
    forms = np.vstack([rest, slow @ rest])
    units = _units(table, first, samples)
    seen = np.einsum("qi,cij,qj->qc", forms, units, forms, optimize=True)
    added = np.stack([gain @ unit @ gain.T for unit in units])
    return _Effects(seen, np.einsum("qi,qi,i->q", forms, forms, 1.0 / weight), slow, added, amplitude_mv)


def _sizes(groups: Sequence[tuple[PulseFit, Residuals, _Effects]], settings: RangingSettings) -> FloatArray:
    """Find the sizes (C,) of the components that explain the residuals of all groups."""
    rows, values = [], []
    for fit, left, effects in groups:
        usable = usable_records(fit, left, settings)
        if not usable.any():
            continue
        deviations, used = left.deviations[usable], left.used[usable]
        count = np.concatenate([used.sum(axis=0), np.full(len(effects.waves), len(deviations))])
        total = np.concatenate([np.sum(deviations**2, axis=0), np.sum((deviations @ effects.waves.T) ** 2, axis=0)])
        usual = np.maximum(effects.calibrated, settings.least_expected)
        scale = np.sqrt(count / 2.0) / usual  # a mean of R squares of normal deviates scatters by sqrt(2 / R)
        relative = fit.amplitude_mv[usable] / effects.amplitude_mv
        growth = np.ones(len(COMPONENTS))
        growth[JITTER] = growth[ENERGY] = np.mean(relative**2)
        growth[SLOPE] = np.mean(left.sweeps[usable])  # mains hum is the same in every sweep
        rows.append(effects.seen * growth * scale[:, None])
        values.append((total / np.maximum(count, 1) - effects.calibrated) * scale)
    if not rows:
        return np.zeros(len(COMPONENTS))
    return _significant(np.concatenate(rows), np.concatenate(values), settings)


def _significant(rows: FloatArray, values: FloatArray, settings: RangingSettings) -> FloatArray:
    """Fit components, and take those away, the least sure first, that do not stand out of their own scatter."""
    sizes = np.zeros(rows.shape[1])
    alone = values @ rows / np.maximum(np.sqrt(np.einsum("qc,qc->c", rows, rows)), 1e-300)
    if alone.max() < settings.component_sigmas:
        return sizes  # as on the day of the calibration
    kept = np.ones(rows.shape[1], dtype=np.bool_)
    while kept.any():
        found, _ = nnls(rows[:, kept], values)
        sd = np.sqrt(np.diag(np.linalg.pinv(rows[:, kept].T @ rows[:, kept])))
        sure = found / np.maximum(sd, 1e-300)
        if sure.min() >= settings.component_sigmas:
            sizes[kept] = found
            break
        kept[np.flatnonzero(kept)[np.argmin(sure)]] = False
    return sizes


def _added(sizes: FloatArray, effects: _Effects, relative: FloatArray, sweeps: FloatArray) -> FloatArray:
    """Return the covariance (R, 3, 3) that components add to records of relative amplitude (R,)."""
    ones = np.ones_like(relative)
    additive = np.column_stack([1.0 / relative, ones, ones])
    of_pulse = np.column_stack([ones, relative, relative])
    each = sizes[:, None, None] * effects.added
    noise = (each[WHITE] + each[FLICKER]) / sweeps[:, None, None] + each[SLOPE]
    shots = (each[JITTER] + each[ENERGY]) / sweeps[:, None, None]
    return np.asarray(
        noise * additive[:, :, None] * additive[:, None, :] + shots * of_pulse[:, :, None] * of_pulse[:, None, :]
    )
