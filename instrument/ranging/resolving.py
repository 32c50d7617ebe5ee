"""Takes two echoes of one record apart: the first and the last range."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging.noticing import Noticed
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template_fit import PulseFit
from picoradar.instrument.ranging.two_pulses import UNKNOWNS, TwoPulses, fit_two_pulses

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Echoes(NamedTuple):
    """Echoes of R records, their delays from the same instants.

    Attributes
    ----------
    first, last : PulseFit
        ``last`` is NaN where there is one echo only.
    between : (R, 2, 2) float array
        Covariance of delay and amplitude of the first with those of the last (ps, mV); NaN where there is one.
    resolved : (R,) bool array
        Records with two echoes that are told apart.
    """

    first: PulseFit
    last: PulseFit
    between: FloatArray
    resolved: BoolArray


def resolve(
    noticed: Noticed,
    traces_mv: FloatArray,
    place_ps: FloatArray,
    table: ShapeTable,
    asked: BoolArray,
    settings: RangingSettings,
) -> Echoes:
    """Fit two echoes where they are asked for, and keep them where they are told apart.

    Parameters
    ----------
    noticed : Noticed
        Fits of one echo, R records.
    traces_mv : (R, S) float array
        Traces or windows in which the echoes lie.
    place_ps : (R,) float array
        Where the delays of the fits count from, after the first sample.
    table : ShapeTable
    asked : (R,) bool array
    settings : RangingSettings
    """
    fit = noticed.fit
    records = len(fit.delay_ps)
    blank = np.full(records, np.nan)
    last = PulseFit(blank, blank, blank, np.full((records, 3, 3), np.nan), blank, blank)
    between = np.full((records, 2, 2), np.nan)
    alone = Echoes(fit, last, between, np.zeros(records, dtype=np.bool_))
    these = np.flatnonzero(asked)
    if not len(these) or fit.residuals is None:
        return alone
    step = table.step_ps
    samples = min(traces_mv.shape[1], round((settings.two_lead_ps + settings.two_trail_ps) / step))
    at = fit.delay_ps[these] + place_ps[these]
    cut = np.clip(np.rint((at - settings.two_lead_ps) / step).astype(np.int64), 0, traces_mv.shape[1] - samples)
    pieces = np.take_along_axis(traces_mv[these], cut[:, None] + np.arange(samples), axis=1)
    amplitude = np.maximum(fit.amplitude_mv[these], settings.min_response_mv)
    two = fit_two_pulses(pieces, table, at - cut * step, amplitude, fit.residuals.sweeps[these], settings)
    noise = np.full(len(these), _noise(two, samples, settings))
    apart = two.told_apart(noise, settings) & (two.values[:, 2] - two.values[:, 0] > settings.least_apart_ps)
    if not apart.any():
        return alone
    origin = (cut * step - place_ps[these])[apart]
    covariance = two.covariance[apart] * noise[apart, None, None]
    chosen = these[apart]
    between[chosen] = covariance[:, :2, 2:4]
    resolved = np.zeros(records, dtype=np.bool_)
    resolved[chosen] = True
    values = TwoPulses(two.values[apart], covariance, two.square[apart])
    return Echoes(
        _with(fit, chosen, values, (0, 1, 4), origin), _with(last, chosen, values, (2, 3, 4), origin), between, resolved
    )


def _noise(two: TwoPulses, samples: int, settings: RangingSettings) -> float:
    """Return how many times the calibrated variance most fits of two pulses leave; 1 where noise explains it."""
    freedom = samples - UNKNOWNS
    usual = float(np.median(two.square)) / freedom
    return usual if usual > 1.0 + settings.component_sigmas * np.sqrt(2.0 / freedom) else 1.0


def _with(
    fit: PulseFit, records: NDArray[np.intp], two: TwoPulses, which: tuple[int, int, int], origin_ps: FloatArray
) -> PulseFit:
    """Put one of two pulses in the place of what was fitted."""
    delay, amplitude, baseline = (array.copy() for array in fit[:3])
    covariance = fit.covariance.copy()
    delay[records] = two.values[:, which[0]] + origin_ps
    amplitude[records], baseline[records] = two.values[:, which[1]], two.values[:, which[2]]
    covariance[records] = two.covariance[:, which][:, :, which]
    return fit._replace(delay_ps=delay, amplitude_mv=amplitude, baseline_mv=baseline, covariance=covariance)
