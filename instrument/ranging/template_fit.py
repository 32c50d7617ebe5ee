"""Maximum-likelihood fit of delay, amplitude and baseline of one pulse to a short piece of trace, records together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging.outliers import outlying
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import Entries, ShapeTable

FloatArray = NDArray[np.float64]

UNKNOWNS = 3  # delay, amplitude, baseline


class Residuals(NamedTuple):
    """What fits leave of pieces (R, M).

    Attributes
    ----------
    deviations : (R, M) float array
        In standard deviations of the calibrated noise; 0 where a sample was left out.
    used : (R, M) bool array
        Samples that were not left out.
    entries : Entries
        Of the table, that the fits ended at.
    table : ShapeTable
    sweeps : (R,) float array
    """

    deviations: FloatArray
    used: NDArray[np.bool_]
    entries: Entries
    table: ShapeTable
    sweeps: FloatArray

    @property
    def square(self) -> FloatArray:
        """Get the sums (R,) of the squared deviations."""
        return np.asarray(np.einsum("rm,rm->r", self.deviations, self.deviations), dtype=np.float64)

    @property
    def freedom(self) -> NDArray[np.int64]:
        """Get the samples (R,) beyond the unknowns, 1 at least: what noise as calibrated makes the square."""
        return np.asarray(np.maximum(self.used.sum(axis=1) - UNKNOWNS, 1), dtype=np.int64)

    @property
    def usual(self) -> tuple[int, float]:
        """Get place in the table and amplitude (mV) of the entry that is the middle one of the records."""
        delay, amplitude = np.median(self.entries.delay_ps), np.median(self.entries.amplitude_mv)
        entry = self.table.locate(np.array([delay]), np.array([amplitude]), self.deviations.shape[1])
        return int(entry.first[0]), float(entry.amplitude_mv[0])


class PulseFit(NamedTuple):
    """Fit of one pulse in each of R records.

    Attributes
    ----------
    delay_ps, amplitude_mv, baseline_mv : (R,) float arrays
        The delay counts from the first sample of the piece.
    covariance : (R, 3, 3) float array
        Of these three, for the sweeps averaged.
    misfit_sigmas : (R,) float array
        By how many of its standard deviations the sum of squared residuals over their variances is more than noise
        gives: above 5 or 6 the shape is another one.
    residual_mv : (R,) float array
        Root mean square of the residuals.
    residuals : Residuals, optional
        What the fits leave; none where nothing was fitted.
    """

    delay_ps: FloatArray
    amplitude_mv: FloatArray
    baseline_mv: FloatArray
    covariance: FloatArray
    misfit_sigmas: FloatArray
    residual_mv: FloatArray
    residuals: Residuals | None = None


def fit_pulses(
    pieces_mv: FloatArray,
    table: ShapeTable,
    delay_ps: FloatArray,
    amplitude_mv: FloatArray,
    sweeps: FloatArray,
    settings: RangingSettings,
) -> PulseFit:
    """Fit ``b + s(t; tau, A)`` to pieces of traces by Gauss-Newton steps on the weighted residuals.

    With independent normal noise of known variance this is the maximum of the likelihood, and the inverse of the normal
    matrix is the Cramer-Rao bound of the piece (docs/ranging.md). Samples that lie far off the fit, as those of a shot
    that misfired, are then replaced by it, which leaves them out, and these records are fitted once more, until the
    same ones are left out again.

    Parameters
    ----------
    pieces_mv : (R, M) float array
        Mean traces.
    table : ShapeTable
    delay_ps, amplitude_mv : (R,) float arrays
        Where to start.
    sweeps : (R,) float array
        Sweeps averaged.
    settings : RangingSettings
    """
    fit = _fit(pieces_mv, table, delay_ps, amplitude_mv, sweeps, settings)
    out = np.zeros(pieces_mv.shape, dtype=np.bool_)
    for _ in range(settings.outlier_rounds):
        far = outlying(fit.deviations, settings)
        again = np.flatnonzero((far != out).any(axis=1))
        if not len(again):
            break
        out = far
        raw = pieces_mv[again]
        repaired = np.where(far[again], raw - fit.deviations[again] / fit.root_weight[again], raw)
        better = _fit(repaired, table, fit.delay_ps[again], fit.amplitude_mv[again], sweeps[again], settings)
        # Samples left out keep their own residuals, by which they are judged again.
        better.deviations[:] += (raw - repaired) * better.root_weight
        for old, new in zip(fit.arrays, better.arrays, strict=True):
            old[again] = new
    return _judged(fit, out, table, sweeps)


class _Fit(NamedTuple):
    delay_ps: FloatArray
    amplitude_mv: FloatArray
    baseline_mv: FloatArray
    information: FloatArray  # of a single sweep
    deviations: FloatArray
    root_weight: FloatArray  # of the sweeps averaged: inverse standard deviations
    entries: Entries

    @property
    def arrays(self) -> tuple[FloatArray | NDArray[np.int64], ...]:
        return *self[:-1], *self.entries


def _judged(fit: _Fit, out: NDArray[np.bool_], table: ShapeTable, sweeps: FloatArray) -> PulseFit:
    """Return the fit without the information of the samples that were left out."""
    samples = out.shape[1]
    information, deviations, used = fit.information, fit.deviations, np.full(len(out), samples)
    some = np.flatnonzero(out.any(axis=1))
    if len(some):
        design = table.design(fit.entries.first[some], samples)  # (3, K, M)
        weight = fit.root_weight[some] ** 2 / sweeps[some, None] * out[some]
        information = information.copy()
        information[some] -= np.einsum("ikm,jkm,km->kij", design, design, weight)
        deviations = np.where(out, 0.0, deviations)
        used = samples - out.sum(axis=1)
    freedom = np.maximum(used - UNKNOWNS, 1)
    misfit = np.einsum("rm,rm->r", deviations, deviations)
    left = deviations / fit.root_weight
    return PulseFit(
        fit.delay_ps,
        fit.amplitude_mv,
        fit.baseline_mv,
        np.linalg.inv(information) / sweeps[:, None, None],
        (misfit - freedom) / np.sqrt(2.0 * freedom),
        np.sqrt(np.einsum("rm,rm->r", left, left) / used),
        Residuals(deviations, ~out, fit.entries, table, sweeps),
    )


def _fit(
    pieces: FloatArray,
    table: ShapeTable,
    delay_ps: FloatArray,
    amplitude_mv: FloatArray,
    sweeps: FloatArray,
    settings: RangingSettings,
) -> _Fit:
    """Take Gauss-Newton steps, each on the records that have not settled yet.

    The slope of a pulse goes with its amplitude, and the entries of the table are up to 7 % off it: to the linear model
    belongs the mixed term ``-s' dtau dA / A``, which makes the first unknown ``dtau (1 + dA / A)``. Without it the
    error of the start comes through by those 7 %.
    """
    records, samples = pieces.shape
    prior = np.eye(UNKNOWNS) / settings.prior_sd**2
    delay, amplitude = delay_ps.copy(), amplitude_mv.copy()
    baseline = np.empty(records)
    moving = np.arange(records)
    for _ in range(settings.max_steps):
        part = pieces if len(moving) == records else pieces[moving]
        near = table.locate(delay[moving], amplitude[moving], samples)
        normal = table.normal_matrix(near, samples) + prior
        step = np.linalg.solve(normal, table.score(near, part)[:, :, None])[:, :, 0]
        before = delay[moving]
        amplitude[moving], baseline[moving] = near.amplitude_mv + step[:, 1], step[:, 2]
        grown = np.maximum(amplitude[moving] / near.amplitude_mv, settings.min_growth)
        delay[moving] = near.delay_ps + np.clip(step[:, 0] / grown, -settings.max_move_ps, settings.max_move_ps)
        moving = moving[np.abs(delay[moving] - before) > settings.settled_ps]
        if not len(moving):
            break
    # Where the last entry was depends on the last delay but one, so it is looked up again for the residuals.
    near = table.locate(delay, amplitude, samples)
    moved = (delay - near.delay_ps) * amplitude / near.amplitude_mv
    rest = np.column_stack([moved, amplitude - near.amplitude_mv, baseline])
    left, root = table.residual(near, rest, pieces)
    if (sweeps != 1.0).any():
        root = root * np.sqrt(sweeps)[:, None]
    left *= root
    information = table.information(delay, amplitude, samples) + prior
    return _Fit(delay, amplitude, baseline, information, left, root, near)
