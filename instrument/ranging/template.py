"""The template estimator on whole traces: both pulses fitted with the shapes of the calibration."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, ShotNoise, Templates
from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.half_maximum import Edges, ExternalReference
from picoradar.instrument.ranging.noticing import notice
from picoradar.instrument.ranging.pair import PulsePair
from picoradar.instrument.ranging.pulses import CoarseTraces
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import PulseFamily, ShapeTable
from picoradar.instrument.ranging.template_fit import UNKNOWNS, PulseFit, fit_pulses

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Shapes = tuple[Templates, ShotNoise]

MIN_VARIANCE_MV2 = 1e-12  # of a baseline without noise: its weight must stay finite
NO_KNOWLEDGE = np.eye(3) * 1e12  # covariance (ps^2, mV^2) of what counts for nothing


def shapes_of(calibration: Calibration) -> Shapes:
    """Return pulse shapes and noise of a calibration.

    Raises
    ------
    BadInput
        When it has no templates or does not know the noise.
    """
    if calibration.templates is None or calibration.noise.floor_mv <= 0:
        raise BadInput(
            "the template estimator needs a calibration with templates and noise floor; "
            "learn them on the bench (picoradar bench gray-target) or use half-maximum"
        )
    return calibration.templates, calibration.noise


def tables(shapes: Shapes, step_ps: float, settings: RangingSettings) -> tuple[ShapeTable, ShapeTable]:
    """Return the look-up tables of reference and echo for a sampling step."""
    return _tables(*shapes, step_ps, settings)


@lru_cache(maxsize=16)
def _tables(
    templates: Templates, noise: ShotNoise, step_ps: float, settings: RangingSettings
) -> tuple[ShapeTable, ShapeTable]:
    def table(response_mv: tuple[float, ...], shapes: tuple[tuple[float, ...], ...]) -> ShapeTable:
        family = PulseFamily(templates.start_ps, templates.step_ps, np.array(response_mv), np.array(shapes))
        return ShapeTable(family, noise, step_ps, settings)

    return table((templates.reference_mv,), (templates.reference,)), table(templates.response_mv, templates.echoes)


def fit_pair(
    traces_mv: FloatArray,
    times_ps: FloatArray,
    coarse: CoarseTraces,
    edges: tuple[Edges, Edges],
    shapes: Shapes,
    sweeps: FloatArray,
    settings: RangingSettings,
) -> tuple[PulsePair, BoolArray, BoolArray]:
    """Fit reference and echo of whole traces; return the pair, and where there is a second echo and a distorted pulse.

    Each pulse is fitted on its own piece of the trace, from where `half_maximum` found it. Both share one baseline,
    which the samples before the reference know too: the three findings of it are combined, which gives just what one
    fit of everything would (`combine`).
    """
    step_ps = float(times_ps[1] - times_ps[0])
    start, stop = edges
    fits, firsts = [], []
    for table, edge in zip(tables(shapes, step_ps, settings), edges, strict=True):
        if isinstance(edge, ExternalReference):
            fits.append(_exact(edge))
            firsts.append(np.zeros_like(edge.time_ps))
            continue
        pieces, first = _cut(traces_mv, times_ps, edge.time_ps, settings)
        guess = np.nan_to_num(edge.time_ps - times_ps[first])
        height = np.nan_to_num(edge.height_mv, nan=settings.start_height_mv)
        fits.append(fit_pulses(pieces, table, guess, height, sweeps, settings))
        firsts.append(times_ps[first])
    (first_one,), (second_one,) = notice([fits[0]], [fits[1]], settings)
    lost = np.isnan(start.time_ps) | np.isnan(stop.time_ps)
    echo = unreliable(second_one.fit, lost)
    pair = combine(first_one.fit, echo, firsts[0], firsts[1], coarse.baseline_mv, coarse.baseline_variance_mv2)
    return _without(pair, lost, np.isnan(start.time_ps)), second_one.second, first_one.distorted | second_one.distorted


def _exact(edge: Edges) -> PulseFit:
    """Return instants from elsewhere as fits without error, which know nothing of amplitude and baseline."""
    none, unknown = np.zeros_like(edge.time_ps), np.full_like(edge.time_ps, np.nan)
    covariance = np.zeros((len(none), UNKNOWNS, UNKNOWNS))
    covariance[:, 2, 2] = NO_KNOWLEDGE[2, 2]
    return PulseFit(np.nan_to_num(edge.time_ps), unknown, none, covariance, none, none)


def combine(
    reference: PulseFit,
    echo: PulseFit,
    reference_first_ps: FloatArray,
    echo_first_ps: FloatArray,
    baseline_mv: FloatArray | None = None,
    baseline_variance_mv2: FloatArray | None = None,
) -> PulsePair:
    """Join the fits of two pieces of a trace that share one baseline.

    The baselines b1, b2 of the fits, and a third finding of it if there is one, are made equal by conditioning: with
    weights ``w_i = 1 / var(b_i)`` the common one is their weighted mean b, of variance ``1 / sum w_i``, and each
    pulse's delay and amplitude move by ``cov(x, b_i) w_i (b - b_i)``. For normal errors this is the joint fit.
    """
    found = [(reference.baseline_mv, reference.covariance[:, 2, 2]), (echo.baseline_mv, echo.covariance[:, 2, 2])]
    if baseline_mv is not None and baseline_variance_mv2 is not None:
        found.append((baseline_mv, np.maximum(baseline_variance_mv2, MIN_VARIANCE_MV2)))
    total = np.sum([1.0 / variance for _, variance in found], axis=0)
    common = np.sum([value / variance for value, variance in found], axis=0) / total

    def conditioned(fit: PulseFit) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return delay and amplitude (R, 2), their covariance with the baseline known, and their share of it."""
        share = fit.covariance[:, :2, 2] / fit.covariance[:, 2, 2][:, None]
        moved = np.column_stack([fit.delay_ps, fit.amplitude_mv]) + share * (common - fit.baseline_mv)[:, None]
        own = fit.covariance[:, :2, :2] - share[:, :, None] * fit.covariance[:, None, 2, :2]
        return moved, own, share

    (first, first_own, first_share), (second, second_own, second_share) = conditioned(reference), conditioned(echo)
    delay_share = second_share[:, 0] - first_share[:, 0]
    return PulsePair(
        reference_ps=reference_first_ps + first[:, 0],
        reference_mv=first[:, 1],
        reference_variance_ps2=first_own[:, 0, 0] + first_share[:, 0] ** 2 / total,
        echo_variance_ps2=second_own[:, 0, 0] + second_share[:, 0] ** 2 / total,
        interval_ps=echo_first_ps - reference_first_ps + second[:, 0] - first[:, 0],
        interval_variance_ps2=first_own[:, 0, 0] + second_own[:, 0, 0] + delay_share**2 / total,
        response_mv=second[:, 1],
        response_variance_mv2=second_own[:, 1, 1] + second_share[:, 1] ** 2 / total,
        covariance_ps_mv=second_own[:, 0, 1] + delay_share * second_share[:, 1] / total,
    )


def bad_fit(fit: PulseFit, limits: RangingSettings) -> NDArray[np.bool_]:
    """Return where a pulse does not have the shape of the calibration: more misfit than noise gives, and more than a
    shape that has aged a little."""
    return (fit.misfit_sigmas > limits.worst_misfit_sigmas) & (
        fit.residual_mv > limits.worst_residual * fit.amplitude_mv
    )


def unreliable(fit: PulseFit, where: NDArray[np.bool_]) -> PulseFit:
    """Return a fit whose baseline counts for nothing where there is no pulse, so that it does not move the other
    one."""
    covariance = np.where(where[:, None, None], NO_KNOWLEDGE, fit.covariance)
    return fit._replace(baseline_mv=np.where(where, 0.0, fit.baseline_mv), covariance=covariance)


def _cut(
    traces_mv: FloatArray, times_ps: FloatArray, edge_ps: FloatArray, settings: RangingSettings
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Cut a piece about each time-significant point; at an end of the trace it is moved inwards."""
    step_ps = float(times_ps[1] - times_ps[0])
    lead = settings.piece_lead_ps
    samples = min(round((lead + settings.piece_trail_ps) / step_ps), len(times_ps))
    first = np.rint((np.nan_to_num(edge_ps, nan=times_ps[0]) - lead - times_ps[0]) / step_ps).astype(np.int64)
    first = np.clip(first, 0, len(times_ps) - samples)
    return np.take_along_axis(traces_mv, first[:, None] + np.arange(samples), axis=1), first


def _without(pair: PulsePair, lost: NDArray[np.bool_], no_reference: NDArray[np.bool_]) -> PulsePair:
    """Blank what has no time-significant point."""
    alone = ("reference_ps", "reference_mv", "reference_variance_ps2")
    return replace(
        pair,
        **{
            field.name: np.where(no_reference if field.name in alone else lost, np.nan, getattr(pair, field.name))
            for field in fields(pair)
        },
    )
