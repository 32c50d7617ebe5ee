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
    amplitude_mv : float
    """

    seen: FloatArray
    calibrated: FloatArray
    waves: FloatArray
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

    def refined(self, fit: PulseFit) -> PulseFit:
        """Return a fit that knows this noise: generalised least squares, with its covariance.

        Parameters
        ----------
        fit : PulseFit
            With the residuals that this noise was found in, or more.
        """
        left = fit.residuals
        if left is None or not self._sizes.any():
            return fit
        samples = left.deviations.shape[1]
        change, covariance = np.zeros((len(fit.delay_ps), UNKNOWNS)), fit.covariance.copy()
        delay = np.median(left.entries.delay_ps)
        kinds = np.stack([left.entries.amplitude_mv, left.sweeps], axis=1)
        for amplitude, sweeps in np.unique(kinds, axis=0):
            these = np.flatnonzero((kinds == (amplitude, sweeps)).all(axis=1))
            entry = left.table.locate(np.array([delay]), np.array([amplitude]), samples)
            known = _generalised(left.table, int(entry.first[0]), samples, float(sweeps), tuple(self._sizes.tolist()))
            change[these] = left.deviations[these] @ known.gain.T
            covariance[these] += known.more
        return fit._replace(
            delay_ps=fit.delay_ps + change[:, 0],
            amplitude_mv=fit.amplitude_mv + change[:, 1],
            baseline_mv=fit.baseline_mv + change[:, 2],
            covariance=covariance,
        )

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
        if not self._sizes.any():
            return np.eye(samples)
        first, _ = left.usual
        return _covariance(left.table, first, samples, float(np.median(left.sweeps)), self._sizes)


class _Generalised(NamedTuple):
    """Generalised least squares at an entry: change (3, M) of the unknowns by deviations that the fit left, and by what
    the covariance (3, 3) is more than with the calibrated noise."""

    gain: FloatArray
    more: FloatArray


@lru_cache(maxsize=256)
def _generalised(table: ShapeTable, first: int, samples: int, sweeps: float, sizes: tuple[float, ...]) -> _Generalised:
    at = np.array([first])
    design = table.design(at, samples)[:, 0] * np.sqrt(table.weights(at, samples)[0] * sweeps)  # (3, M)
    known = np.linalg.solve(_covariance(table, first, samples, sweeps, np.array(sizes)), design.T)  # (M, 3)
    covariance = np.linalg.pinv(design @ known, hermitian=True)
    return _Generalised(covariance @ known.T, covariance - np.linalg.pinv(design @ design.T, hermitian=True))


def _covariance(table: ShapeTable, first: int, samples: int, sweeps: float, sizes: FloatArray) -> FloatArray:
    """Return the covariance (M, M) of deviations with components of these sizes."""
    root = np.sqrt(table.weights(np.array([first]), samples)[0])
    scaled = sizes.copy()
    scaled[SLOPE] *= sweeps
    extra = np.einsum("c,cij->ij", scaled, _units(table, first, samples)) * root[:, None] * root
    return np.asarray(np.eye(samples) + extra, dtype=np.float64)


def _effects_of(left: Residuals, waves: int) -> _Effects:
    """Look up what unit components do to the usual record of a group."""
    return _effects(left.table, *left.usual, left.deviations.shape[1], waves)


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
    squares = forms**2
    seen = np.stack([squares @ np.diagonal(units[kind]) for kind in (WHITE, JITTER, ENERGY)], axis=1)  # diagonal ones
    of_flicker = np.einsum("qi,qi->q", forms @ units[FLICKER], forms)
    seen = np.column_stack([seen, of_flicker, (forms @ place) ** 2])
    return _Effects(seen, squares @ (1.0 / weight), slow, amplitude_mv)


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
