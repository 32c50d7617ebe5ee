"""The template estimator on windowed records: two short pieces of the trace instead of all of it (SBP 1.1)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.drivers.traces import Window
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging.combining import baselines_apart_mv2, combine, unreliable
from picoradar.instrument.ranging.noticing import Noticed, notice
from picoradar.instrument.ranging.overlap import without_other
from picoradar.instrument.ranging.pair import (
    Last,
    PulsePair,
    mark,
    mark_misplaced,
    share_reference,
    to_ranges,
    with_stretch,
)
from picoradar.instrument.ranging.ranges import Ranges
from picoradar.instrument.ranging.resolving import resolve
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.stretch import Stretched
from picoradar.instrument.ranging.template import shapes_of, tables
from picoradar.instrument.ranging.windows.fit import PointWindows
from picoradar.instrument.ranging.windows.pulse import FoundPulse, find_pulse
from picoradar.instrument.ranging.windows.traces import WindowTraces

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
FlagArray = NDArray[np.uint16]

BLOCK = 512  # records handled together: their windows stay in the cache


def estimate_windows(
    reference: WindowTraces,
    echo: WindowTraces,
    *,
    calibration: Calibration,
    clipped: ArrayLike = False,
    shared_reference: bool = False,
    settings: RangingSettings | None = None,
) -> Ranges:
    """Range records of two windows, one over the reference and one where the echo is expected.

    A record whose echo is not in its window, with room before and behind the 50 % point, has `Flag.NO_ECHO`: take it
    again with a wider window.

    Parameters
    ----------
    reference, echo : WindowTraces
        Of the same R records. A window may also be long and coarse (a search).
    calibration : Calibration
        With templates and noise.
    clipped : (R,) bool array, optional
        Records in which the device has seen samples at an end of its A/D.
    shared_reference : bool
        Use the mean instant of the reference over these records (taken one shortly after the other, as those of a line)
        if their scatter allows it; see `pair.share_reference`.

    Raises
    ------
    BadInput
        When the calibration has no templates, or the windows are not of the same records.
    """
    limits = settings or RangingSettings()
    seen_clipped = np.broadcast_to(np.asarray(clipped, dtype=np.bool_), (len(reference.values_mv),))
    fitted = _pairs([(reference, echo)], seen_clipped, calibration, limits)
    return _ranges(fitted, calibration, limits, shared_reference=shared_reference)


def estimate_points(
    points: Sequence[PointWindows],
    traces_mv: Sequence[tuple[ArrayLike, ArrayLike]],
    *,
    calibration: Calibration,
    clipped: ArrayLike = False,
    shared_reference: bool = False,
    settings: RangingSettings | None = None,
) -> Ranges:
    """Range points whose windows may differ in length, step and sweeps, those of the same form together.

    Parameters
    ----------
    points : sequence of N PointWindows
        The windows as they were taken.
    traces_mv : sequence of N pairs of arrays
        Mean traces of the reference window and the echo window. A trace of another length than its window is flagged
        as without reference.
    calibration, clipped, shared_reference, settings
        As `estimate_windows`.
    """
    limits = settings or RangingSettings()
    seen_clipped = np.broadcast_to(np.asarray(clipped, dtype=np.bool_), (len(points),))
    forms: dict[tuple[float, int, float, int], list[int]] = defaultdict(list)
    for number, point in enumerate(points):
        r, e = point.reference, point.echo
        forms[r.step_ps, r.samples, e.step_ps, e.samples].append(number)
    order = [number for numbers in forms.values() for number in numbers]
    windows = [
        (
            _gather([(points[n].reference, traces_mv[n][0]) for n in numbers]),
            _gather([(points[n].echo, traces_mv[n][1]) for n in numbers]),
        )
        for numbers in forms.values()
    ]
    fitted = _pairs(windows, seen_clipped[order], calibration, limits)
    return _ranges(fitted.taken(np.argsort(order)), calibration, limits, shared_reference=shared_reference)


def with_retaken(ranges: Ranges, points: NDArray[np.intp], again: Ranges) -> Ranges:
    """Return a line with the points (M,) that were taken again in place of the first try, flagged
    `Flag.RETAKEN`."""
    order = np.arange(len(ranges.flags))
    order[points] = len(order) + np.arange(len(points))
    flagged = replace(again, flags=again.flags | np.uint16(Flag.RETAKEN))
    return Ranges.joined([ranges, flagged]).taken(order)


def _gather(windows: Sequence[tuple[Window, ArrayLike]]) -> WindowTraces:
    """Put windows of the same form together; a trace of another length becomes NaN."""
    samples = windows[0][0].samples
    rows = [np.asarray(trace, dtype=np.float64) for _, trace in windows]
    return WindowTraces.of(
        np.stack([row if row.shape == (samples,) else np.full(samples, np.nan) for row in rows]),
        [window.start_ps for window, _ in windows],
        windows[0][0].step_ps,
        [window.sweeps for window, _ in windows],
    )


def _pairs(
    windows: Sequence[tuple[WindowTraces, WindowTraces]],
    seen_clipped: BoolArray,
    calibration: Calibration,
    limits: RangingSettings,
) -> _Fitted:
    """Range groups of records whose windows have the same form, one group after the other."""
    groups = []
    for reference, echo in windows:
        records = len(reference.values_mv)
        if records != len(echo.values_mv):
            raise BadInput(f"{records} reference windows and {len(echo.values_mv)} echo windows")
        blocks = [slice(first, first + BLOCK) for first in range(0, max(records, 1), BLOCK)]
        groups += [(reference.part(block), echo.part(block)) for block in blocks]
    shapes = shapes_of(calibration)
    firsts = [find_pulse(reference, tables(shapes, reference.step_ps, limits)[0], limits) for reference, _ in groups]
    seconds = []
    for (_, echo), first in zip(groups, firsts, strict=True):
        of_reference, of_echo = tables(shapes, echo.step_ps, limits)
        seconds.append(find_pulse(_without_tail(echo, first, of_reference, limits), of_echo, limits))
    noticed = notice([found.fit for found in firsts], [found.fit for found in seconds], limits, shapes.stretch)
    echoes = [
        resolve(
            other,
            second.values_mv,
            second.place_ps,
            tables(shapes, echo.step_ps, limits)[1],
            ~second.missing & ~first.missing & (other.second | other.poor | second.others),
            limits,
        )
        for (_, echo), first, second, other in zip(groups, firsts, seconds, noticed[1], strict=True)
    ]
    fits = [
        (unreliable(one.fit, first.missing), unreliable(found.first, second.missing))
        for first, second, one, found in zip(firsts, seconds, noticed[0], echoes, strict=True)
    ]
    apart = baselines_apart_mv2(fits, limits)
    starts = [(first.first_ps, second.first_ps) for first, second in zip(firsts, seconds, strict=True)]
    pairs = [combine(*both, *start, apart_mv2=apart) for both, start in zip(fits, starts, strict=True)]
    last = None
    if any(found.resolved.any() for found in echoes):
        of_last = [
            combine(reference, found.last, *start, apart_mv2=apart)
            for (reference, _), found, start in zip(fits, echoes, starts, strict=True)
        ]
        last = Last(PulsePair.joined(of_last), np.concatenate([found.between for found in echoes]))
    flags = [
        _flags(group, (first, second), (one, other._replace(second=other.second | found.resolved)), limits)
        for group, first, second, one, other, found in zip(groups, firsts, seconds, *noticed, echoes, strict=True)
    ]
    together = np.concatenate(flags)
    mark(together, Flag.CLIPPED, seen_clipped)
    return _Fitted(PulsePair.joined(pairs), last, together, Stretched.joined([one.stretched for one in noticed[1]]))


def _without_tail(
    echo: WindowTraces, reference: FoundPulse, of_reference: ShapeTable, limits: RangingSettings
) -> WindowTraces:
    """Return windows over the echo without the tail of the reference, where it reaches into them."""
    after_ps = echo.first_ps - reference.first_ps
    near = ~reference.missing & (after_ps - reference.fit.delay_ps < limits.table_reach_ps)
    return replace(echo, values_mv=without_other(echo.values_mv, after_ps, reference.fit, of_reference, near))


class _Fitted(NamedTuple):
    """Records whose windows are fitted: pair of the first echo, the last echoes if there are any, flags, and how echoes
    are stretched, if it was asked for."""

    pair: PulsePair
    last: Last | None
    flags: FlagArray
    stretched: Stretched | None

    def taken(self, records: NDArray[np.intp]) -> _Fitted:
        last = self.last
        if last is not None:
            last = Last(last.pair.taken(records), last.between[records])
        found = None if self.stretched is None else self.stretched.taken(records)
        return _Fitted(self.pair.taken(records), last, self.flags[records], found)


def _flags(
    windows: tuple[WindowTraces, WindowTraces],
    found: tuple[FoundPulse, FoundPulse],
    judged: Sequence[Noticed],
    limits: RangingSettings,
) -> FlagArray:
    (first, second), (one, other) = found, judged
    flags = np.zeros(len(first.missing), dtype=np.uint16)
    ranged = ~second.missing & ~first.missing
    mark(flags, Flag.NO_REFERENCE, first.missing)
    mark(flags, Flag.NO_ECHO, second.missing & ~first.missing)
    mark(flags, Flag.MIXED, ranged & (other.second | second.others))
    mark(flags, Flag.DISTORTED, ranged & (one.distorted | other.distorted) & ~other.second)
    lowest, highest = limits.clip_mv
    for window in windows:
        mark(flags, Flag.CLIPPED, (window.values_mv.min(axis=1) < lowest) | (window.values_mv.max(axis=1) > highest))
    return flags


def _ranges(fitted: _Fitted, calibration: Calibration, limits: RangingSettings, *, shared_reference: bool) -> Ranges:
    pair, last, flags, stretched = fitted
    mark_misplaced(flags, pair, calibration)
    use = (flags & np.uint16(Flag.NO_REFERENCE)) == 0
    if shared_reference:
        pair = share_reference(pair, use, limits)
        last = None if last is None else Last(share_reference(last.pair, use, limits), last.between)
    return with_stretch(to_ranges(pair, flags, "template", calibration, limits, last), stretched)
