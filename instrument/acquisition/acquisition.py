"""`Acquisition`: a plan and a capture put together; the job that the controller runs line by line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from picoradar.drivers.interfaces import Galvo, Identity, Sampler
from picoradar.drivers.traces import CodeScale
from picoradar.instrument.acquisition.capture import MARK_RUNS, Capture, Devices, Revisit, Setup
from picoradar.instrument.acquisition.line import to_scan_line
from picoradar.instrument.acquisition.line_size import refuse_enormous_lines
from picoradar.instrument.acquisition.motion import MotionMonitor
from picoradar.instrument.acquisition.order import LineOrder
from picoradar.instrument.acquisition.plan import Plan
from picoradar.instrument.acquisition.resumption import Resumption
from picoradar.instrument.acquisition.row import Row, TakenRows
from picoradar.instrument.acquisition.zero_mark import MarkPlan
from picoradar.instrument.controller import Between
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import Flag, ScanLine, ZeroReading
from picoradar.instrument.ranging import LineBefore, Ranges, mark_footprint

POINT_BYTES = 256  # of a point on the disk, without its raw samples
REST_S = 0.1  # after which a motion of the mirrors by the whole field has left no trace: 20 times their creep of 5 ms


class Acquisition:
    """Takes the lines of a plan by a capture, judges them, and puts them into space.

    Where the plan is a raster, neighbours tell whether a spot lies on one surface (`Flag.MIXED`). Any plan of enough
    lines is monitored by a `MotionMonitor`.

    Parameters
    ----------
    plan : Plan
        Where the beam goes.
    capture : Capture
        How a line is taken.
    setup : Setup
    rows : sequence of int, optional
        Lines to take; all by default.
    mark : MarkPlan, optional
        The mark that the range zero is checked by; without one it is not.

    Attributes
    ----------
    shots : int
        Laser shots sampled so far at the plan's points (without those that settle or monitor motion): divided by
        the PRF, the time that shots alone take.

    Raises
    ------
    BadInput
        When a line does not fit into memory while it is ranged.
    """

    def __init__(
        self,
        plan: Plan,
        capture: Capture,
        setup: Setup,
        rows: Sequence[int] | None = None,
        mark: MarkPlan | None = None,
    ) -> None:
        refuse_enormous_lines(plan.columns, setup.settings.sampler.samples)
        self.plan = plan
        self.capture = capture
        self.shots = 0
        self._setup = setup
        self._mark = mark
        self._order = LineOrder(plan.rows, setup.settings.scan.order if plan.step_mm is not None else "rows")
        self._rows = self._order.sorted(range(plan.rows) if rows is None else rows)
        self._reference: tuple[float, float | None] = (0.0, None)
        revisit_s, line_s = capture.times_s(plan.columns)
        pointing_sd_mm = setup.calibration.pointing_sd_rad * setup.settings.scan.distance_mm
        self._motion = MotionMonitor(plan.rows, revisit_s, line_s, pointing_sd_mm)
        self._taken = TakenRows(self._order)
        self._beside_next: Row | None = None
        self._row_before = -1
        self._states: dict[int, JsonObject] = {-1: self.state_dict()}
        self._resumption = Resumption(self._states, self._order, math.ceil(capture.memory_s / line_s))

    @property
    def mode(self) -> str:
        """Get how it really scans."""
        return self.capture.mode

    @property
    def rows(self) -> Sequence[int]:
        """Get the rows to take, in order."""
        return self._rows

    @property
    def line_bytes(self) -> int:
        """Get the most that one line takes on the disk (its samples not compressed)."""
        raw_bytes = self.capture.raw_bytes if self._setup.settings.scan.keep_traces else 0
        return self.plan.columns * (POINT_BYTES + raw_bytes)

    @property
    def reference(self) -> tuple[float, float | None]:
        """Get the lowest amplitude (mV) and median instant (ps) of the reference in the last line; 0 and None: none."""
        return self._reference

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler how records are taken."""
        self.capture.configure(sampler)

    def header(self, identities: Mapping[str, Identity], *, seed: int | None, scale: CodeScale) -> JsonObject:
        """Get the header of the recording: all that one must know to use or repeat the scan."""
        settings, calibration = self._setup.settings, self._setup.calibration
        stretch = calibration.stretch_terms(settings.scan.material, self.capture.ranging)
        return {
            "raster": {
                "plan": self.plan.name,
                "rows": self.plan.rows,
                "columns": self.plan.columns,
                **self.plan.header(),
                "mode": self.capture.mode,
                **({} if self._order.name == "rows" else {"order": self._order.name}),
                "averages": settings.scan.averages,
                "estimator": self.capture.estimator,
            },
            "settings": settings.model_dump(),
            "seed": seed,
            "calibration": calibration.content(),
            "calibration_digest": calibration.digest,
            "range_error": calibration.range_error(settings.scan.material, self.capture.ranging)._asdict(),
            **({} if stretch is None else {"stretch": stretch}),
            "scanner": {name: str(identity) for name, identity in identities.items()},
            "trace": {
                **settings.sampler.model_dump(include={"start_ps", "step_ps", "samples"}),
                "zero_code": scale.zero_code,
                "mv_per_code": scale.mv_per_code,
            },
        }

    def state_dict(self) -> JsonObject:
        """Get what the next line needs to know of those before, as plain data."""
        before = None if self._beside_next is None else self._beside_next.state_dict()
        return {"motion": self._motion.state_dict(), "before": before, **self.capture.state_dict()}

    def load_state(self, state: JsonObject) -> None:
        """Go on from a `state_dict`, as if the lines before had just been taken."""
        if "motion" in state:  # recordings of earlier versions have none
            self._motion.load_state(state["motion"])
        if before := state.get("before"):
            self._beside_next = Row.from_state(before)
            self._taken.add(self._beside_next)
        self.capture.load_state(state)

    def resume_from(self, states: Mapping[int, JsonObject], lines: Iterable[ScanLine] = ()) -> None:
        """Take in the lines so far, and the states recorded after them, by their numbers."""
        self._states.update(states)
        for line in lines:
            self._taken.add(Row(line.index, LineBefore(line.range_mm, line.range_variance_mm2)))

    def goes_on_at(self, row: int) -> bool:
        """Get whether the row before was not taken just now, so that the scan goes on here after a stop."""
        return self._order.last_before(row) != self._row_before

    def run_up(self, row: int) -> Sequence[int]:
        """Get the rows to take again, and to drop, before a row at which the scan goes on."""
        return self._resumption.rows_before(row)

    def recall(self, row: int) -> JsonObject:
        """Go back to what was known before a row; returns what was recorded then, empty when nothing is."""
        if state := self._resumption.state_before(row):
            self.load_state(state)
        return state

    def take_zero(self, galvo: Galvo, sampler: Sampler, between: Between) -> ZeroReading | None:
        """Take the records of the zero mark with the laser on, before the first line or after the last; None: no mark.

        Raises
        ------
        DeviceError
        """
        if self._mark is None:
            return None
        at_end, began_s = self._row_before >= 0, self._setup.clock.now()
        run_id = self.plan.run_id(2 * self.plan.rows, 0) + MARK_RUNS * at_end  # behind those of lines and repeats
        traces, windows, clipped = self.capture.take_mark(run_id, self._mark, Devices(galvo, sampler, between))
        if not at_end:
            galvo.move(galvo.codes // 2, galvo.codes // 2)  # as if the beam had come from there to the first line
            self._setup.clock.sleep(REST_S)
        return self._mark.reading(began_s, clipped=clipped, traces=traces, windows=windows)

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:
        """Take one line with the laser on.

        Parameters
        ----------
        row : int
        galvo, sampler
            Open and configured; the gate is open.
        between : callable
            Called before the line and before each point; what it raises ends the line.

        Raises
        ------
        DeviceError
        """
        self.plan.wait_for(row, between)
        self._row_before = row
        line = self.plan.line(row)
        began_s = self._setup.clock.now()
        captured = self.capture.take(self.plan, line, self._revisit(), Devices(galvo, sampler, between))
        self.shots += captured.shots
        ranges = self._footprint_judged(row, captured.ranges)
        ranges = self._motion_judged(row, ranges, captured.revisit)
        self._note_reference(ranges)
        captured = replace(captured, ranges=ranges)
        if not self._setup.settings.scan.keep_traces:
            captured = replace(captured, traces=None, windows=None)
        return to_scan_line(line, captured, self._setup.calibration, began_s)

    def _revisit(self) -> Revisit | None:
        """Return the monitored point, if it is its turn."""
        if self._motion.point is None or not self._motion.due:
            return None
        row, column = self._motion.point
        return Revisit(self.plan.line(row).codes[column], *self._motion.seen)

    def _footprint_judged(self, row: int, ranges: Ranges) -> Ranges:
        """Flag points whose spot does not lie on one surface, as far as this line and the one before show it."""
        if self.plan.step_mm is None:
            return ranges
        beside = self._taken.beside(row)
        self._taken.add(Row(row, LineBefore(ranges.range_mm, ranges.variance_mm2)))
        self._beside_next = self._taken.beside_next(row)
        return mark_footprint(ranges, self.plan.step_mm, None if beside is None else beside.ranges)

    def _motion_judged(self, row: int, ranges: Ranges, revisit: Ranges | None) -> Ranges:
        """Take the revisit in, and flag the line if the target has moved."""
        self._motion.line_done(row, ranges, self.plan.step_mm, revisit)
        if not self._motion.moved:
            return ranges
        return replace(ranges, flags=ranges.flags | np.uint16(Flag.MOTION))

    def _note_reference(self, ranges: Ranges) -> None:
        there = np.isfinite(ranges.reference_mv)
        self._reference = (0.0, None)
        if 2 * np.count_nonzero(there) >= len(there):
            self._reference = float(ranges.reference_mv[there].min()), float(np.median(ranges.reference_ps[there]))
