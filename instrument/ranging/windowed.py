"""The template estimator on windowed records: two short pieces of the trace instead of all of it (SBP 1.1)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from instrument.calibration import Calibration
from instrument.errors import BadInput
from instrument.ranging.pair import PulsePair, mark, mark_misplaced, share_reference, to_ranges
from instrument.ranging.ranges import Ranges
from instrument.ranging.settings import RangingSettings
from instrument.ranging.shape_table import ShapeTable
from instrument.ranging.template import LEAD_PS, TRAIL_PS, bad_fit, combine, shapes_of, tables, unreliable
from instrument.ranging.template_fit import PulseFit, fit_pulses
from instrument.ranging.window import Place, Window
from instrument.scan_line import Flag

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
FlagArray = NDArray[np.uint16]

SMOOTH_PS = 60.0
FOOT_PS, TOP_PS = 80.0, 130.0  # least way of the 50 % point from either end of its window
LEAST_SAMPLES = 12
BLOCK = 512  # records handled together: their windows stay in the cache


@dataclass(frozen=True)
class WindowTraces:
    """One window of R records, all of the same length and step.

    Attributes
    ----------
    values_mv : (R, M) float array
        Mean traces.
    first_ps : (R,) float array
        Sampling instant of the first sample.
    step_ps : float
    sweeps : (R,) float array
    """

    values_mv: FloatArray
    first_ps: FloatArray
    step_ps: float
    sweeps: FloatArray

    @classmethod
    def of(cls, values_mv: ArrayLike, first_ps: ArrayLike, step_ps: float, sweeps: ArrayLike = 1) -> WindowTraces:
        """Make one of what can be broadcast to it.

        Raises
        ------
        BadInput
            When the shapes do not fit, or a window has fewer than 12 samples.
        """
        values = np.asarray(values_mv, dtype=np.float64)
        if values.ndim != 2 or values.shape[1] < LEAST_SAMPLES or not step_ps > 0:
            raise BadInput(
                f"a window needs (R, M >= {LEAST_SAMPLES}) samples and a positive step, "
                f"not shape {values.shape} and {step_ps:g} ps"
            )
        try:
            first = np.broadcast_to(np.asarray(first_ps, dtype=np.float64), (len(values),))
            counts = np.broadcast_to(np.asarray(sweeps, dtype=np.float64), (len(values),))
        except ValueError as error:
            raise BadInput(f"first_ps and sweeps must be one value or {len(values)} values: {error}") from error
        if len(values) and not counts.min() >= 1:
            raise BadInput(f"sweeps must be at least 1, not {counts.min():g}")
        return cls(values, first, float(step_ps), counts)

    def part(self, records: slice) -> WindowTraces:
        """Return some of the records."""
        return WindowTraces(self.values_mv[records], self.first_ps[records], self.step_ps, self.sweeps[records])


def estimate_windows(
    reference: WindowTraces,
    echo: WindowTraces,
    *,
    calibration: Calibration,
    clipped: ArrayLike = False,
    shared_reference: bool = False,
    settings: RangingSettings | None = None,
) -> Ranges:
    """Range records of two windows, one over the reference and one over the place where the echo is expected.

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
        Use the mean place of the reference over these records (taken one shortly after the other, as those of a line)
        if their scatter allows it; see `pair.share_reference`.

    Raises
    ------
    BadInput
        When the calibration has no templates, or the windows are not of the same records.
    """
    limits = settings or RangingSettings()
    seen_clipped = np.broadcast_to(np.asarray(clipped, dtype=np.bool_), (len(reference.values_mv),))
    pair, flags = _pairs(reference, echo, seen_clipped, calibration, limits)
    return _ranges(pair, flags, shared_reference, calibration, limits)


def estimate_places(
    places: Sequence[Place],
    traces_mv: Sequence[tuple[ArrayLike, ArrayLike]],
    *,
    calibration: Calibration,
    clipped: ArrayLike = False,
    shared_reference: bool = False,
    settings: RangingSettings | None = None,
) -> Ranges:
    """Range places whose windows may differ in length, step and sweeps, those of the same form together.

    Parameters
    ----------
    places : sequence of N Place
        The windows as they were taken.
    traces_mv : sequence of N pairs of arrays
        Mean traces of the reference window and the echo window. A trace of another length than its window is flagged
        as without reference.
    calibration, clipped, shared_reference, settings
        As `estimate_windows`.
    """
    limits = settings or RangingSettings()
    seen_clipped = np.broadcast_to(np.asarray(clipped, dtype=np.bool_), (len(places),))
    forms: dict[tuple[float, int, float, int], list[int]] = defaultdict(list)
    for number, place in enumerate(places):
        r, e = place.reference, place.echo
        forms[r.step_ps, r.samples, e.step_ps, e.samples].append(number)
    order: list[int] = []
    pairs: list[PulsePair] = []
    flags: list[FlagArray] = []
    for numbers in forms.values():
        reference = _gather([(places[n].reference, traces_mv[n][0]) for n in numbers])
        echo = _gather([(places[n].echo, traces_mv[n][1]) for n in numbers])
        pair, found = _pairs(reference, echo, seen_clipped[numbers], calibration, limits)
        order += numbers
        pairs.append(pair)
        flags.append(found)
    back = np.argsort(order)
    return _ranges(
        PulsePair.joined(pairs).taken(back), np.concatenate(flags)[back], shared_reference, calibration, limits
    )


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
    reference: WindowTraces,
    echo: WindowTraces,
    seen_clipped: BoolArray,
    calibration: Calibration,
    limits: RangingSettings,
) -> tuple[PulsePair, FlagArray]:
    records = len(reference.values_mv)
    if records != len(echo.values_mv):
        raise BadInput(f"{records} reference windows and {len(echo.values_mv)} echo windows")
    blocks = [slice(first, first + BLOCK) for first in range(0, max(records, 1), BLOCK)]
    found = [_block(reference.part(b), echo.part(b), seen_clipped[b], calibration, limits) for b in blocks]
    return PulsePair.joined([pair for pair, _ in found]), np.concatenate([flags for _, flags in found])


def _block(
    reference: WindowTraces,
    echo: WindowTraces,
    seen_clipped: BoolArray,
    calibration: Calibration,
    limits: RangingSettings,
) -> tuple[PulsePair, FlagArray]:
    first_fit, first_ps, no_reference = _fit(reference, tables(shapes_of(calibration), reference.step_ps)[0], limits)
    second_fit, second_ps, no_echo = _fit(echo, tables(shapes_of(calibration), echo.step_ps)[1], limits)
    flags = np.zeros(len(reference.values_mv), dtype=np.uint16)
    mark(flags, Flag.NO_REFERENCE, no_reference | bad_fit(first_fit, limits))
    mark(flags, Flag.NO_ECHO, no_echo & ~no_reference)
    mark(flags, Flag.MIXED, ~no_echo & ~no_reference & bad_fit(second_fit, limits))
    lowest, highest = limits.clip_mv
    for window in (reference, echo):
        mark(flags, Flag.CLIPPED, (window.values_mv.min(axis=1) < lowest) | (window.values_mv.max(axis=1) > highest))
    mark(flags, Flag.CLIPPED, seen_clipped)
    pair = combine(unreliable(first_fit, no_reference), unreliable(second_fit, no_echo), first_ps, second_ps)
    return pair, flags


def _ranges(
    pair: PulsePair, flags: FlagArray, shared_reference: bool, calibration: Calibration, limits: RangingSettings
) -> Ranges:
    mark_misplaced(flags, pair, calibration)
    if shared_reference:
        pair = share_reference(pair, (flags & np.uint16(Flag.NO_REFERENCE)) == 0)
    return to_ranges(pair, flags, "template", calibration, limits)


def _fit(window: WindowTraces, table: ShapeTable, limits: RangingSettings) -> tuple[PulseFit, FloatArray, BoolArray]:
    """Fit the pulse in each window; also return the instant that its delay counts from, and where there is no pulse."""
    usable = np.asarray(np.isfinite(window.values_mv).all(axis=1), dtype=np.bool_)
    values = window.values_mv if usable.all() else np.where(usable[:, None], window.values_mv, 0.0)
    edge, height = _half_way(values, window.step_ps)
    samples = min(values.shape[1], round((LEAD_PS + TRAIL_PS) / window.step_ps))
    cut = np.zeros(len(values), dtype=np.int64)
    if samples < values.shape[1]:
        cut = np.clip(edge - round(LEAD_PS / window.step_ps), 0, values.shape[1] - samples)
        values = np.take_along_axis(values, cut[:, None] + np.arange(samples), axis=1)
    guess = np.asarray((edge - cut) * window.step_ps, dtype=np.float64)
    fit = fit_pulses(values, table, guess, height, window.sweeps)
    place = fit.delay_ps + cut * window.step_ps
    sd = np.sqrt(fit.covariance[:, 1, 1])
    no_pulse = (
        ~usable
        | (fit.amplitude_mv < np.maximum(limits.detection_sigmas * sd, limits.least_response_mv))
        | (place < FOOT_PS)
        | (place > (window.values_mv.shape[1] - 1) * window.step_ps - TOP_PS)
    )
    return fit, window.first_ps + cut * window.step_ps, no_pulse


def _half_way(values: FloatArray, step_ps: float) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the sample nearest to half way up to the highest, and that height, in smoothed traces."""
    width = max(1, min(round(SMOOTH_PS / step_ps), values.shape[1] // 4))
    sums = np.cumsum(values, axis=1)
    smooth = (sums[:, width:] - sums[:, :-width]) / width  # of samples 1 .. M - 1
    top = np.argmax(smooth, axis=1)
    index = np.arange(smooth.shape[1])
    high = np.take_along_axis(smooth, top[:, None], axis=1)
    low = np.min(np.where(index <= top[:, None], smooth, np.inf), axis=1, keepdims=True)
    below = (smooth < (high + low) / 2) & (index <= top[:, None])
    last = smooth.shape[1] - 1 - np.argmax(below[:, ::-1], axis=1)
    edge = np.where(below.any(axis=1), last, 0) + 1 + width // 2
    return edge, np.maximum((high - low)[:, 0], 1.0)
