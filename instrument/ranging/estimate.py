"""`estimate`: whole traces in, ranges out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.instrument.calibration import METHODS, Calibration, Method, ShotNoise
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import NO_RANGE, Flag
from picoradar.instrument.ranging.half_maximum import external_reference, half_maximum, join
from picoradar.instrument.ranging.judging import flag_pulses
from picoradar.instrument.ranging.overlap import moved_by_tail
from picoradar.instrument.ranging.padding import with_ends_filled
from picoradar.instrument.ranging.pair import Last, mark, to_ranges, with_stretch
from picoradar.instrument.ranging.pulses import coarse_traces, next_pulse
from picoradar.instrument.ranging.ranges import Ranges
from picoradar.instrument.ranging.self_calibration import self_calibrate
from picoradar.instrument.ranging.settings import LearningSettings, RangingSettings
from picoradar.instrument.ranging.stretch import Stretched
from picoradar.instrument.ranging.template import FoundEdges, Shapes, fit_pair, shapes_of

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BLOCK = 256  # records handled together: their traces stay in the cache


def estimate(
    traces: FloatArray | Sequence[ArrayLike],
    times_ps: ArrayLike,
    *,
    method: Method = "template",
    calibration: Calibration | None = None,
    sweeps: ArrayLike = 1,
    clipped: ArrayLike | None = None,
    settings: RangingSettings | None = None,
    learning: LearningSettings | None = None,
    reference_ps: ArrayLike | None = None,
) -> Ranges:
    """Range records that hold reference and echo in one trace, or the echo alone (docs/ranging.md).

    Traces of other instruments, in volts or counts, need settings for their pulses (docs/foreign-traces.md).

    A record that cannot be ranged gets flags and NaN; no content of a trace raises. The range is
    ``c / 2 x Ti + range_zero - walk(response)`` with Ti the interval between the time-significant points.

    Parameters
    ----------
    traces : (R, S) float array, or a sequence of R traces
        Mean traces in mV. A trace of another length, or with NaN, is flagged as without reference.
    times_ps : (S,) array
        Sampling instants, evenly spaced.
    method : {"template", "half-maximum"}
        The fit of the calibration's pulse shapes (self-calibrated without one: then a record's range depends on the
        others of the call), or the dissertation's 50 % crossing.
    calibration : Calibration, optional
        Without it the range counts from Ti = 0, and `Flag.WALK_EXTRAPOLATED` says that no walk correction covers it.
    sweeps : int or (R,) array
        Sweeps averaged in each trace.
    clipped : (R,) bool array, optional
        Records in which the device has seen samples at an end of its A/D.
    settings : RangingSettings, optional
    learning : LearningSettings, optional
        Of the shapes that are learnt from the records themselves.
    reference_ps : float or (R,) array, optional
        Time zero from elsewhere, on the axis of ``times_ps`` and taken as exact; the first pulse of a trace is then the
        echo. NaN: that record has no reference.

    Raises
    ------
    BadInput
        When ``times_ps`` is no evenly spaced axis, another argument does not fit, or templates are missing.

    Examples
    --------
    Two pulses of one form, 4000 ps apart:

    >>> import numpy as np
    >>> from picoradar import estimate
    >>> times_ps = 10.0 * np.arange(800)
    >>> trace_mv = sum(45.0 * np.exp(-(((times_ps - at_ps) / 250.0) ** 2)) for at_ps in (1500.0, 5500.0))
    >>> estimate([trace_mv], times_ps, method="half-maximum").range_mm.round(1)
    array([599.4])
    """
    limits = settings or RangingSettings()
    times = _check_times(times_ps, limits)
    records = _records(traces, times.size, limits.fill_samples, sweeps, clipped, reference_ps)
    return _in_blocks(records, _way(records, times, method, calibration, limits, learning))


class _Records(NamedTuple):
    """Checked input: traces (R, S), which can be used, their sweeps, where the device has seen clipping, and references
    from elsewhere (R,), if there are any."""

    traces: FloatArray
    usable: BoolArray
    sweeps: FloatArray
    seen_clipped: BoolArray
    reference_ps: FloatArray | None

    def part(self, records: slice) -> _Records:
        traces, usable, sweeps, seen_clipped, reference = self
        reference = None if reference is None else reference[records]
        return _Records(traces[records], usable[records], sweeps[records], seen_clipped[records], reference)


class _Way(NamedTuple):
    """How records are ranged."""

    times: FloatArray
    method: Method
    shapes: Shapes | None
    calibration: Calibration | None
    limits: RangingSettings


def _way(
    records: _Records,
    times: FloatArray,
    method: Method,
    calibration: Calibration | None,
    limits: RangingSettings,
    learning: LearningSettings | None,
) -> _Way:
    """Choose the shapes that records are fitted with: the calibration's, or those of the records themselves."""
    if method not in METHODS:
        raise BadInput(f"method {method!r} is not known; use {' or '.join(map(repr, METHODS))}")
    shapes: Shapes | None = None
    if method == "template" and _enough(records, times, limits):
        if calibration:
            shapes = shapes_of(calibration)
        else:
            single = records.reference_ps is not None
            learnt = self_calibrate(records.traces, times, limits, records.sweeps, learning, single=single)
            shapes = None if learnt is None else Shapes(*learnt)
    return _Way(times, method, shapes, calibration, limits)


def _enough(records: _Records, times: FloatArray, limits: RangingSettings) -> bool:
    return len(records.traces) > 0 and times.size >= limits.min_samples


def _in_blocks(records: _Records, way: _Way) -> Ranges:
    count = len(records.traces)
    if not _enough(records, way.times, way.limits):
        return _nothing(count)
    return Ranges.joined([_block(records.part(slice(k, k + BLOCK)), way) for k in range(0, count, BLOCK)])


def _records(
    traces: FloatArray | Sequence[ArrayLike],
    samples: int,
    fill_samples: int,
    sweeps: ArrayLike,
    clipped: ArrayLike | None,
    reference_ps: ArrayLike | None,
) -> _Records:
    values, usable = _stack(traces, samples, fill_samples)
    records = len(values)
    try:
        counts = np.broadcast_to(np.asarray(sweeps, dtype=np.float64), (records,))
        seen_clipped = np.broadcast_to(np.asarray(False if clipped is None else clipped, dtype=np.bool_), (records,))
        external = reference_ps if reference_ps is None else np.asarray(reference_ps, dtype=np.float64)
        external = external if external is None else np.broadcast_to(external, (records,))
    except ValueError as error:
        raise BadInput(
            f"sweeps, clipped and reference_ps must be one value or {records} values, one a record: {error}"
        ) from error
    if records and not np.all(counts >= 1):
        raise BadInput(f"sweeps must be at least 1, not {np.min(counts):g}")
    return _Records(values, usable, counts, seen_clipped, external)


def _block(records: _Records, way: _Way) -> Ranges:
    traces, usable, sweeps, seen_clipped, external = records
    times, method, shapes, calibration, limits = way
    coarse = coarse_traces(traces, float(times[1] - times[0]), limits)
    first = next_pulse(coarse, limits)
    reference, echo = (first, next_pulse(coarse, limits, first)) if external is None else (None, first)
    further = next_pulse(coarse, limits, echo)
    noise = calibration.noise if calibration else ShotNoise()
    stop = half_maximum(traces, times, coarse, echo, noise, sweeps, limits)
    if external is None:
        start = half_maximum(traces, times, coarse, first, noise, sweeps, limits)
    else:
        start = external_reference(external)

    flags = flag_pulses(coarse, (reference, echo, further), (start, stop), limits)
    mark(flags, Flag.NO_REFERENCE, ~usable)
    lowest, highest = limits.clip_mv
    ends = (traces.min(axis=1) < lowest) | (traces.max(axis=1) > highest)
    mark(flags, Flag.CLIPPED, usable & (seen_clipped | ends))
    pair = join(start, stop, coarse)
    last: Last | None = None
    stretched: Stretched | None = None
    if method == "template" and shapes is None:  # no record has two clear pulses, so there is nothing to fit with
        mark(flags, Flag.NO_ECHO, (flags & np.uint16(Flag.NO_REFERENCE)) == 0)
    elif shapes is None:
        if external is None and calibration and calibration.templates is not None:
            mark(flags, Flag.OVERLAPPED, moved_by_tail(start, stop, calibration.templates))
    else:
        fitted = fit_pair(traces, times, coarse, FoundEdges(start, stop, further.found), shapes, sweeps, limits)
        pair, last, stretched = fitted.pair, fitted.last, fitted.stretched
        ranged = (flags & np.uint16(NO_RANGE)) == 0
        mark(flags, Flag.MIXED, ranged & fitted.second)
        mark(flags, Flag.DISTORTED, ranged & fitted.distorted)
    return with_stretch(to_ranges(pair, flags, method, calibration, limits, last), stretched)


def _check_times(times_ps: ArrayLike, limits: RangingSettings) -> FloatArray:
    times = np.asarray(times_ps, dtype=np.float64)
    if times.ndim != 1 or times.size < 2 or not np.all(np.isfinite(times)):
        raise BadInput(f"times_ps must be a row of finite sampling instants, not an array of shape {times.shape}")
    steps = np.diff(times)
    step = (times[-1] - times[0]) / (times.size - 1)
    if step <= 0 or np.max(np.abs(steps - step)) > limits.max_step_deviation * step:
        raise BadInput(
            f"times_ps must be evenly spaced and increase; its steps go from {steps.min()} to {steps.max()} ps"
        )
    return times


def _stack(traces: FloatArray | Sequence[ArrayLike], samples: int, fill_samples: int) -> tuple[FloatArray, BoolArray]:
    """Return the traces as (R, samples), zeros where a trace cannot be used, and which can."""
    if isinstance(traces, np.ndarray) and traces.ndim != 2:
        raise BadInput(f"traces must be one row a record, not an array of shape {traces.shape}")
    if isinstance(traces, np.ndarray) and traces.shape[1] == samples:
        values = np.asarray(traces, dtype=np.float64)
    else:
        rows = [np.asarray(trace, dtype=np.float64) for trace in traces]
        values = np.full((len(rows), samples), np.nan)
        for value, row in zip(values, rows, strict=True):
            if row.shape == (samples,):
                value[:] = row
    values = with_ends_filled(values, fill_samples)
    usable = np.asarray(np.isfinite(values).all(axis=1), dtype=np.bool_)
    return (values if usable.all() else np.where(usable[:, None], values, 0.0)), usable


def _nothing(records: int) -> Ranges:
    blank = np.full(records, np.nan)
    return Ranges(blank, blank, blank, np.full(records, Flag.NO_REFERENCE, dtype=np.uint16), blank, blank, blank, blank)
