"""The template estimator on whole traces: both pulses fitted with the shapes of the calibration."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, ShotNoise, Stretch, Templates
from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.combining import NO_KNOWLEDGE, baselines_apart_mv2, combine, unreliable
from picoradar.instrument.ranging.half_maximum import Edges, ExternalReference
from picoradar.instrument.ranging.noticing import notice
from picoradar.instrument.ranging.overlap import ROUNDS, overlapping, without_other
from picoradar.instrument.ranging.pair import Last, PulsePair
from picoradar.instrument.ranging.pulses import CoarseTraces
from picoradar.instrument.ranging.resolving import resolve
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import PulseFamily, ShapeTable
from picoradar.instrument.ranging.stretch import Stretched
from picoradar.instrument.ranging.template_fit import UNKNOWNS, PulseFit, fit_pulses

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MIN_VARIANCE_MV2 = 1e-12  # of a baseline without noise: its weight must stay finite


class Shapes(NamedTuple):
    """What pulses are fitted with: their shapes and noise, and how a material stretches them, if that is known."""

    templates: Templates
    noise: ShotNoise
    stretch: Stretch | None = None


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
    return Shapes(calibration.templates, calibration.noise, calibration.stretch)


def tables(shapes: Shapes, step_ps: float, settings: RangingSettings) -> tuple[ShapeTable, ShapeTable]:
    """Return the look-up tables of reference and echo for a sampling step."""
    return _tables(shapes.templates, shapes.noise, step_ps, settings)


@lru_cache(maxsize=16)
def _tables(
    templates: Templates, noise: ShotNoise, step_ps: float, settings: RangingSettings
) -> tuple[ShapeTable, ShapeTable]:
    def table(response_mv: tuple[float, ...], shapes: tuple[tuple[float, ...], ...]) -> ShapeTable:
        family = PulseFamily(templates.start_ps, templates.step_ps, np.array(response_mv), np.array(shapes))
        return ShapeTable(family, noise, step_ps, settings)

    return table((templates.reference_mv,), (templates.reference,)), table(templates.response_mv, templates.echoes)


class FoundEdges(NamedTuple):
    """Reference and echo of R records as `half_maximum` found them, and where a further pulse follows."""

    start: Edges
    stop: Edges
    further: BoolArray


class PairFit(NamedTuple):
    """Reference and echo of R records: the pair, where there is a second echo, where a pulse has another shape, the
    last echo where there is one that is told apart, and how echoes are stretched, if it was asked for."""

    pair: PulsePair
    second: BoolArray
    distorted: BoolArray
    last: Last | None
    stretched: Stretched | None


def fit_pair(
    traces_mv: FloatArray,
    times_ps: FloatArray,
    coarse: CoarseTraces,
    found: FoundEdges,
    shapes: Shapes,
    sweeps: FloatArray,
    settings: RangingSettings,
) -> PairFit:
    """Fit reference and echo of whole traces.

    Each pulse is fitted on its own piece of the trace, from where `half_maximum` found it. Both share one baseline,
    which the samples before the reference know too: the three findings of it are combined, which gives just what one
    fit of everything would (`combine`). Where the fit asks for it, or a further pulse follows, two echoes are
    fitted.
    """
    step_ps = float(times_ps[1] - times_ps[0])
    start, stop, further = found
    both = tables(shapes, step_ps, settings)
    lost = np.isnan(start.time_ps) | np.isnan(stop.time_ps)
    fits, firsts, of_echo_mv = _fit_both(traces_mv, times_ps, found, both, sweeps, settings)
    (one,), (other,) = notice([fits[0]], [fits[1]], settings, shapes.stretch)
    echoes = resolve(
        other,
        of_echo_mv,
        firsts[1] - times_ps[0],
        both[1],
        ~lost & (other.second | other.poor | further),
        settings,
    )
    pulses = one.fit, unreliable(echoes.first, lost)
    before = coarse.baseline_mv, np.maximum(coarse.baseline_variance_mv2, MIN_VARIANCE_MV2)
    apart = baselines_apart_mv2([pulses], settings)
    pair = combine(*pulses, *firsts, before=before, apart_mv2=apart)
    last = None
    if echoes.resolved.any():
        last_pair = combine(one.fit, echoes.last, *firsts, before=before, apart_mv2=apart)
        last = Last(last_pair, echoes.between)
    second = other.second | echoes.resolved
    distorted = (one.distorted | other.distorted) & ~second
    return PairFit(_without(pair, lost, np.isnan(start.time_ps)), second, distorted, last, other.stretched)


class _Fits(NamedTuple):
    """Fits of reference and echo, the instants (R,) that their delays count from, and the traces (R, S) in which the
    echo is by itself."""

    fits: list[PulseFit]
    firsts: list[FloatArray]
    of_echo_mv: FloatArray


def _fit_both(
    traces_mv: FloatArray,
    times_ps: FloatArray,
    found: FoundEdges,
    both: tuple[ShapeTable, ShapeTable],
    sweeps: FloatArray,
    settings: RangingSettings,
) -> _Fits:
    """Fit both pulses, again without each other where they overlap."""
    edges = found.start, found.stop
    parts = [_cut(traces_mv, times_ps, edge.time_ps, settings) for edge in edges]
    pieces, firsts = [piece for piece, _ in parts], [times_ps[first] for _, first in parts]

    def fitted(k: int, piece: FloatArray) -> PulseFit:
        guess = np.nan_to_num(edges[k].time_ps - firsts[k])
        height = np.nan_to_num(edges[k].height_mv, nan=settings.start_height_mv)
        return fit_pulses(piece, both[k], guess, height, sweeps, settings)

    if isinstance(found.start, ExternalReference):
        return _Fits([_exact(found.start), fitted(1, pieces[1])], [np.zeros_like(firsts[0]), firsts[1]], traces_mv)
    fits = [fitted(0, pieces[0]), fitted(1, pieces[1])]
    near = overlapping(found.start.time_ps, found.stop.time_ps, settings)
    rounds = ROUNDS if near.any() else 0
    for _ in range(rounds):
        fits[1] = fitted(1, without_other(pieces[1], firsts[1] - firsts[0], fits[0], both[0], near))
        fits[0] = fitted(0, without_other(pieces[0], firsts[0] - firsts[1], fits[1], both[1], near))
    return _Fits(fits, firsts, without_other(traces_mv, times_ps[0] - firsts[0], fits[0], both[0], near))


def _exact(edge: Edges) -> PulseFit:
    """Return instants from elsewhere as fits without error, which know nothing of amplitude and baseline."""
    none, unknown = np.zeros_like(edge.time_ps), np.full_like(edge.time_ps, np.nan)
    covariance = np.zeros((len(none), UNKNOWNS, UNKNOWNS))
    covariance[:, 2, 2] = NO_KNOWLEDGE[2, 2]
    return PulseFit(np.nan_to_num(edge.time_ps), unknown, none, covariance, none, none)


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
