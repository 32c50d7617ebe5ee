"""`WindowPlanner`: where the windows of the next line lie, and how many shots are just enough.

A whole line runs without the host (advance input), so its windows are chosen before it, from the lines that are done:

* the reference window always lies where the reference was seen last;
* the echo is expected where the line before saw it in the same column, continued by the step from the line before that;
  the margin grows with the differences to the neighbours;
* points of the first line, points without a neighbour that had an echo, and points taken again get a wide window over
  the whole working range. With a step of a tenth of the rise time and more, that costs little more than a narrow one.

Step, samples and sweeps are the cheapest ones that promise the wanted uncertainty at the response seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import Window
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import NO_RANGE, Flag
from picoradar.instrument.ranging.ranges import RANGE_PER_INTERVAL_MM_PER_PS, Ranges
from picoradar.instrument.ranging.template import shapes_of
from picoradar.instrument.ranging.windows.choice import PlanSettings, cheapest_windows
from picoradar.instrument.ranging.windows.fit import PointWindows

FloatArray = NDArray[np.float64]

RETRY = Flag.NO_ECHO | Flag.NO_REFERENCE | Flag.MIXED


@dataclass
class WindowPlanner:
    """Plans one line after the other.

    Parameters
    ----------
    calibration : Calibration
        With templates, noise, and ``reference_ps``.
    columns : int
        Points in a line.
    settings : PlanSettings

    Raises
    ------
    BadInput
        When the calibration lacks what is needed.
    """

    calibration: Calibration
    columns: int
    settings: PlanSettings = field(default_factory=PlanSettings)

    def __post_init__(self) -> None:
        shapes_of(self.calibration)
        self._reference = self._calibrated_reference()
        blank = np.full(self.columns, np.nan)
        self._echo_ps: list[FloatArray] = [blank, blank]  # the last line, and the one before
        self._response_mv: FloatArray = blank
        self._noise = 1.0  # noise of the day over that of the calibration
        self._choose = lru_cache(maxsize=256)(self._cheapest)

    def line(self) -> list[PointWindows]:
        """Return the windows of all points of the next line."""
        expected, margin = self._expectation()
        response = _filled(self._response_mv, self.settings.first_response_mv)
        return [
            self._windows_at(float(expected[c]), float(margin[c]), float(response[c]), self._reference)
            for c in range(self.columns)
        ]

    def wide(self, columns: Sequence[int] | NDArray[np.integer]) -> list[PointWindows]:
        """Return wide windows for some points, to take them again; the reference, too, is searched anew."""
        response = _filled(self._response_mv, self.settings.first_response_mv)
        reference = self._calibrated_reference()
        return [self._windows_at(np.nan, np.nan, float(response[c]), reference) for c in columns]

    def monitor(self, echo_ps: float, response_mv: float) -> PointWindows:
        """Return the windows to monitor a point that was measured before, with about half of the usual uncertainty and
        a reference of its own."""
        reference_ps, reference_margin_ps = self._reference
        settings = self.settings
        windows = cheapest_windows(
            replace(settings, wanted_sd_mm=settings.monitor_sd_share * settings.wanted_sd_mm / self._noise),
            self.calibration,
            reference_margin_ps=reference_margin_ps,
            margin_ps=settings.margins_ps[-2],
            response_mv=response_mv,
            sharing=1,
        )
        return PointWindows(_at(windows[0], reference_ps), _at(windows[1], echo_ps), wide=False)

    def mark(self, range_mm: float) -> PointWindows:
        """Return the windows over a mark at a known range: wide enough for whatever the radar may be off by (36 mm),
        and a reference of its own, searched anew."""
        settings, (reference_ps, reference_margin_ps) = self.settings, self._calibrated_reference()
        windows = cheapest_windows(
            replace(settings, wanted_sd_mm=settings.mark_sd_mm),
            self.calibration,
            reference_margin_ps=reference_margin_ps,
            margin_ps=settings.margins_ps[-1],
            response_mv=settings.first_response_mv,
            sharing=1,
        )
        echo_ps = reference_ps + (range_mm - self.calibration.range_zero_mm) / RANGE_PER_INTERVAL_MM_PER_PS
        return PointWindows(_at(windows[0], reference_ps), _at(windows[1], echo_ps), wide=True)

    def lost(self, points: Sequence[PointWindows], ranges: Ranges) -> NDArray[np.intp]:
        """Return the columns to be taken again with a wide window.

        These are points whose narrow window showed no echo, no reference or a poor fit, and those whose response has
        dropped against the line and against the line before: there the spot may lie on a rim, with most of its light
        on another surface. Where the line has shown more noise than it was planned for, those that are not sure enough
        are taken again, too.
        """
        before, self._noise = self._noise, self._noise_of(ranges, (ranges.flags & np.uint16(RETRY)) == 0)
        with np.errstate(invalid="ignore"):
            unsure = np.sqrt(ranges.variance_mm2) > self.settings.unsure_share * self.settings.wanted_sd_mm
        unsure &= self._noise > before
        narrow = np.array([not point.wide for point in points], dtype=np.bool_)
        poor = (ranges.flags & np.uint16(RETRY)) != 0
        response, near, share = ranges.response_mv, self.settings.neighbours, self.settings.dropped_share
        usual = np.array([_median(response[max(0, c - near) : c + near + 1]) for c in range(len(response))])
        with np.errstate(invalid="ignore"):
            dropped = response < share * usual
            dropped &= ~(response > share * self._response_mv)  # the line before showed nothing else
        return np.flatnonzero((narrow & (poor | dropped)) | unsure)

    def learn(self, ranges: Ranges) -> None:
        """Take in a line that is done; the next one is planned from it.

        Raises
        ------
        BadInput
            When it has another number of points.
        """
        if len(ranges.echo_ps) != self.columns:
            raise BadInput(f"a line of {len(ranges.echo_ps)} points for a raster of {self.columns} columns")
        good = (ranges.flags & np.uint16(NO_RANGE)) == 0
        self._echo_ps = [np.where(good, ranges.echo_ps, np.nan), self._echo_ps[0]]
        one_surface = good & ((ranges.flags & np.uint16(Flag.MIXED)) == 0)
        self._response_mv = np.where(one_surface, ranges.response_mv, np.nan)
        if np.isfinite(ranges.reference_ps).any():
            self._reference = float(np.nanmedian(ranges.reference_ps)), self.settings.reference_margin_ps

    def state_dict(self) -> dict[str, Any]:
        """Get what the next line is planned from, as plain numbers (NaN where nothing is known)."""
        last, before = self._echo_ps
        return {
            "echo_ps": last.tolist(),
            "echo_before_ps": before.tolist(),
            "response_mv": self._response_mv.tolist(),
            "reference_ps": list(self._reference),
            "noise": self._noise,
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Plan on from a `state_dict`; None stands for NaN."""
        echo, before, response = (
            np.array(state[name], dtype=np.float64) for name in ("echo_ps", "echo_before_ps", "response_mv")
        )
        self._echo_ps, self._response_mv = [echo, before], response
        self._noise = float(state.get("noise", 1.0))  # recordings of earlier versions have none
        reference_ps, margin_ps = state["reference_ps"]
        self._reference = float(reference_ps), float(margin_ps)

    def _calibrated_reference(self) -> tuple[float, float]:
        """Return where the calibration has the reference, and by how much that may be wrong."""
        if self.calibration.reference_ps is None:
            raise BadInput("windows need a calibration with reference_ps, where the reference is on the trace")
        earliest, latest = self.calibration.reference_ps
        return (earliest + latest) / 2, (latest - earliest) / 2 + self.settings.reference_margin_ps

    def _expectation(self) -> tuple[FloatArray, FloatArray]:
        """Return where each echo is expected (ps, NaN: unknown) and by how much that may be wrong."""
        last, before = self._echo_ps
        step = np.where(np.isfinite(last - before), last - before, 0.0)
        padded = np.pad(last, 1, constant_values=np.nan)
        around = np.stack([np.abs(padded[:-2] - last), np.abs(padded[2:] - last), np.abs(step)])
        spread = np.max(np.where(np.isfinite(around), around, 0.0), axis=0)
        # A point whose own column had no echo is expected between its neighbours, if these agree.
        between = (padded[:-2] + padded[2:]) / 2
        apart = np.abs(padded[:-2] - padded[2:])
        expected = np.where(np.isfinite(last), last + step, between)
        margin = np.where(np.isfinite(last), spread, apart) + self.settings.margins_ps[0]
        return np.where(margin <= self.settings.margins_ps[-1], expected, np.nan), margin

    def _windows_at(
        self, expected_ps: float, margin_ps: float, response_mv: float, reference_at: tuple[float, float]
    ) -> PointWindows:
        reference_ps, reference_margin_ps = reference_at
        wide = not np.isfinite(expected_ps)
        if wide:
            zero, scale = self.calibration.range_zero_mm, RANGE_PER_INTERVAL_MM_PER_PS
            nearest = reference_ps + (self.settings.nearest_mm - zero) / scale
            farthest = reference_ps + (self.settings.farthest_mm - zero) / scale
            expected_ps, margin_ps = (nearest + farthest) / 2, (farthest - nearest) / 2
        else:
            margin_ps = next(m for m in self.settings.margins_ps if m >= margin_ps)
        response = self.settings.first_response_mv if np.isnan(response_mv) else response_mv
        # Planned for a little less, in steps of a tenth: then only few forms of windows occur.
        ratio = self.settings.response_rung
        rung = float(ratio ** np.floor(np.log(max(response, self.settings.min_response_mv)) / np.log(ratio)))
        reference, echo = self._choose(reference_margin_ps, margin_ps, rung, self._noise)
        return PointWindows(_at(reference, reference_ps), _at(echo, expected_ps), wide)

    def _noise_of(self, ranges: Ranges, good: NDArray[np.bool_]) -> float:
        """Return how many times the calibrated noise a line has shown, in steps of a tenth: so much less is wanted of
        the next one by the calibration."""
        seen = _median(np.sqrt(ranges.variance_mm2[good]))
        if np.isnan(seen):
            return self._noise
        ratio = min(seen * self._noise / self.settings.wanted_sd_mm, self.settings.most_noise)
        steps = np.floor(np.log(max(ratio, 1.0)) / np.log(self.settings.response_rung))
        return float(self.settings.response_rung**steps)

    def _cheapest(
        self, reference_margin_ps: float, margin_ps: float, response_mv: float, noise: float
    ) -> tuple[Window, Window]:
        return cheapest_windows(
            replace(self.settings, wanted_sd_mm=self.settings.wanted_sd_mm / noise),
            self.calibration,
            reference_margin_ps=reference_margin_ps,
            margin_ps=margin_ps,
            response_mv=response_mv,
            sharing=self.columns,
        )


def _at(window: Window, expected_ps: float) -> Window:
    """Put a window to where its pulse is expected, on the device's grid of 0.1 ps."""
    return Window(round(expected_ps + window.start_ps, 1), window.step_ps, window.samples, window.sweeps)


def _median(values: FloatArray) -> float:
    """Return the median of what is there, NaN of nothing."""
    there = values[np.isfinite(values)]
    return float(np.median(there)) if there.size else float("nan")


def _filled(values: FloatArray, least: float) -> FloatArray:
    """Fill what is missing with the median of the rest, but not with less than usual: where only the rim of the target
    has been seen yet, its weak echoes would make the search of everything else many times as long."""
    return np.where(np.isfinite(values), values, np.fmax(_median(values), least))
