"""What the residuals of fits say about noise that the calibration does not know: its variance components.

A calibration knows the noise of the day on which it was made. Jitter that has grown, an amplifier that has become
noisier, 1/f noise and mains hum leave their mark in the residuals, each in its own way: jitter where the pulse is
steep, 1/f noise and hum in slow waves. Their sizes are the variance components that explain the squares of the residuals
best (least squares of the observed quadratic forms on their expectations, none negative; Rao, J. Multivariate Analysis 1
(1971) 257). Components that the residuals do not show beyond their own scatter are left out, so that on the day of the
calibration the stated covariance stays what it is: the Cramer-Rao bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template_fit import UNKNOWNS, PulseFit, Residuals

FloatArray = NDArray[np.float64]

COMPONENTS = 4  # more white noise, jitter (ps^2 a shot), 1/f noise, slope of the baseline
JITTER = 1


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


def widened(fits: Sequence[PulseFit], settings: RangingSettings) -> tuple[list[PulseFit], list[FloatArray]]:
    """State what the residuals of fits show.

    Parameters
    ----------
    fits : sequence of PulseFit
        Of one radar, taken one shortly after the other. Records of another shape than most do not count.
    settings : RangingSettings

    Returns
    -------
    list of PulseFit
        With the covariance that the components found add.
    list of (R,) arrays
        How many times the sum of squared residuals that noise as calibrated gives they explain, for each record.
    """
    shown = [(fit, fit.residuals) for fit in fits if fit.residuals is not None]
    effects = [_effects_of(fit, left, settings.slow_waves) for fit, left in shown]
    sizes = _sizes([(*pair, one) for pair, one in zip(shown, effects, strict=True)], settings)
    wider, usual = [], []
    known = iter(effects)
    for fit in fits:
        if fit.residuals is None:
            wider.append(fit)
            usual.append(np.ones(len(fit.delay_ps)))
            continue
        one = next(known)
        relative = np.maximum(fit.amplitude_mv / one.amplitude_mv, settings.min_growth)
        sweeps = fit.residuals.sweeps
        wider.append(fit._replace(covariance=fit.covariance + _added(sizes, one, relative, sweeps)))
        samples = fit.residuals.deviations.shape[1]
        extra = one.seen[:samples].sum(axis=0) * sizes / (samples - UNKNOWNS)
        usual.append(1.0 + extra[JITTER] * relative**2 + extra[:JITTER].sum() + extra[JITTER + 1 :].sum())
    return wider, usual


def _effects_of(fit: PulseFit, left: Residuals, waves: int) -> _Effects:
    """Look up what unit components do to the usual record of a group."""
    samples = left.deviations.shape[1]
    middle = left.table.locate(
        np.array([np.median(left.entries.delay_ps)]), np.array([np.median(left.entries.amplitude_mv)]), samples
    )
    return _effects(left.table, int(middle.first[0]), float(middle.amplitude_mv[0]), samples, waves)


@lru_cache(maxsize=256)
def _effects(table: ShapeTable, first: int, amplitude_mv: float, samples: int, waves: int) -> _Effects:
    at = np.array([first])
    design, weight = table.design(at, samples)[:, 0], table.weights(at, samples)[0]
    gain = np.linalg.pinv((design * weight) @ design.T, hermitian=True) @ (design * weight)  # (3, M)
    rest = (np.eye(samples) - design.T @ gain) * np.sqrt(weight)[:, None]  # deviations that a change leaves
    place = np.linspace(-1.0, 1.0, samples)
    slow = np.linalg.qr(np.polynomial.legendre.legvander(place, waves))[0][:, 1:].T / np.sqrt(np.median(weight))
    forms = np.vstack([rest, slow @ (rest * np.sqrt(weight)[:, None])])
    slow = slow * np.sqrt(weight)  # of deviations
    apart = np.abs(np.subtract.outer(np.arange(samples), np.arange(samples)))
    flicker = np.log(samples) - np.log(np.maximum(apart, 0.5))  # of equal power in every octave
    units = (np.eye(samples) / np.median(weight), np.diag(design[0] ** 2), flicker, np.outer(place, place))
    seen = np.stack([np.einsum("qi,ij,qj->q", forms, unit, forms) for unit in units], axis=1)
    added = np.stack([gain @ unit @ gain.T for unit in units])
    return _Effects(seen, np.einsum("qi,qi,i->q", forms, forms, 1.0 / weight), slow, added, amplitude_mv)


def _sizes(groups: Sequence[tuple[PulseFit, Residuals, _Effects]], settings: RangingSettings) -> FloatArray:
    """Find the sizes (C,) of the components that explain the residuals of all groups."""
    rows, values = [], []
    for fit, left, effects in groups:
        square = np.einsum("rm,rm->r", left.deviations, left.deviations) / left.used.sum(axis=1)
        usable = np.isfinite(square) & (fit.amplitude_mv > settings.min_response_mv)
        if not usable.any():
            continue
        usable &= square <= settings.max_pooled_misfit * max(float(np.median(square[usable])), 1.0)
        deviations, used = left.deviations[usable], left.used[usable]
        count = np.concatenate([used.sum(axis=0), np.full(len(effects.waves), len(deviations))])
        total = np.concatenate([np.sum(deviations**2, axis=0), np.sum((deviations @ effects.waves.T) ** 2, axis=0)])
        usual = np.maximum(effects.calibrated, settings.least_expected)
        scale = np.sqrt(count / 2.0) / usual  # a mean of R squares of normal deviates scatters by sqrt(2 / R)
        relative = fit.amplitude_mv[usable] / effects.amplitude_mv
        growth = np.ones(COMPONENTS)
        growth[JITTER] = np.mean(relative**2)
        growth[-1] = np.mean(left.sweeps[usable])  # mains hum is the same in every sweep
        rows.append(effects.seen * growth * scale[:, None])
        values.append((total / np.maximum(count, 1) - effects.calibrated) * scale)
    if not rows:
        return np.zeros(COMPONENTS)
    return _significant(np.concatenate(rows), np.concatenate(values), settings)


def _significant(rows: FloatArray, values: FloatArray, settings: RangingSettings) -> FloatArray:
    """Fit components, and take those away, the least sure first, that do not stand out of their own scatter."""
    kept = np.ones(rows.shape[1], dtype=np.bool_)
    sizes = np.zeros(rows.shape[1])
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
    of_jitter = np.column_stack([ones, relative, relative])
    averaged = np.tensordot(sizes[[0, 2]], effects.added[[0, 2]], axes=1)
    slope = sizes[3] * effects.added[3]
    white_like = averaged / sweeps[:, None, None] + slope
    jitter = sizes[JITTER] * effects.added[JITTER] / sweeps[:, None, None]
    return np.asarray(
        white_like * additive[:, :, None] * additive[:, None, :] + jitter * of_jitter[:, :, None] * of_jitter[:, None, :]
    )
