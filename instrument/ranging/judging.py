"""Flags of whole traces: what number, width and separation of the pulses say against a range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.line import Flag
from picoradar.instrument.ranging.half_maximum import Edges
from picoradar.instrument.ranging.pair import mark
from picoradar.instrument.ranging.pulses import CoarseTraces, Pulses
from picoradar.instrument.ranging.settings import RangingSettings

FlagArray = NDArray[np.uint16]
BoolArray = NDArray[np.bool_]


def flag_pulses(
    coarse: CoarseTraces,
    pulses: tuple[Pulses | None, Pulses, Pulses],
    edges: tuple[Edges, Edges],
    limits: RangingSettings,
) -> FlagArray:
    """Judge reference, echo and what follows; the reference is None where its instant comes from elsewhere."""
    (reference, echo, further), (start, stop) = pulses, edges
    flags = np.zeros(len(start.time_ps), dtype=np.uint16)
    no_start, merged = _judge_reference(coarse, reference, start, limits)
    stop_width = echo.fwhm_ps(coarse)
    with np.errstate(invalid="ignore"):
        no_stop = ~echo.found | np.isnan(stop.time_ps) | (stop_width < limits.narrowest_ps)
        no_stop |= echo.peak >= coarse.values_mv.shape[1] - 2  # the peak may lie behind the end of the trace
        two_surfaces = further.found | (stop_width > limits.widest_ps)
        touching = echo.valley_mv > np.maximum(coarse.step_mv, limits.touching_share * echo.height_mv)
    mark(flags, Flag.NO_REFERENCE, no_start)
    mark(flags, Flag.OVERLAPPED | Flag.NO_ECHO, ~no_start & merged)
    mark(flags, Flag.NO_ECHO, ~no_start & no_stop)
    mark(flags, Flag.OVERLAPPED, ~no_start & echo.found & touching)
    mark(flags, Flag.MIXED, ~no_start & ~no_stop & ~merged & two_surfaces)
    return flags


def _judge_reference(
    coarse: CoarseTraces, reference: Pulses | None, start: Edges, limits: RangingSettings
) -> tuple[BoolArray, BoolArray]:
    """Return where there is no reference, and where it has an echo in it."""
    missing = np.isnan(start.time_ps)
    if reference is None:
        return missing, np.zeros_like(missing)
    width = reference.fwhm_ps(coarse)
    with np.errstate(invalid="ignore"):
        no_start = ~reference.found | missing | (width < limits.narrowest_ps)
        return no_start, np.asarray(width > limits.widest_reference_ps)
