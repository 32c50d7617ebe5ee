"""`WindowCapture`: two short windows a point (SBP 1.1), just enough shots, and a whole line without the host.

The galvo controller plays one path a line. A marked point of it starts each record (advance input). The window over the
reference comes first, while the mirrors still settle: it does not depend on them. Where an echo is lost the point is
taken again with a wide window, in a short path of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.drivers.interfaces import Galvo, Sampler, WindowRecord
from picoradar.drivers.traces import Window
from picoradar.instrument.acquisition.capture import Captured, Devices, MarkRecords, Revisit, Setup
from picoradar.instrument.acquisition.galvo_path import Stop, plan_path
from picoradar.instrument.acquisition.plan import LinePlan, Plan
from picoradar.instrument.acquisition.window_ranging import range_line, range_windows
from picoradar.instrument.acquisition.zero_mark import MarkPlan
from picoradar.instrument.calibration import Method, Ranging
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import LineWindows
from picoradar.instrument.ranging import PlanSettings, PointWindows, Ranges, WindowPlanner

IntArray = NDArray[np.int64]

REVISIT_S = 6e-3  # of a point that is monitored: record and settling
FRAME_S = 1e-3  # a frame of USB at full speed; eight microframes at high speed (USB 2.0, section 5.3.3)
FRAME_SHARE = 0.05  # of a frame: past the start of a frame, so that rounding does not move a line into another one
FORGOTTEN_AFTER = 4.0  # settling times of a fly-back, after which a motion has left no trace


@runtime_checkable
class PathGalvo(Galvo, Protocol):
    """A galvo controller that plays a path by itself, once the whole of it is there."""

    def play(self, xy: ArrayLike, marked: ArrayLike, rate_hz: int) -> None:
        """Play (n, 2) codes once at ``rate_hz`` points a second, with the marker line high where marked."""


@runtime_checkable
class WindowSampler(Sampler, Protocol):
    """A sampler that takes records in windows, each at an edge of its advance input."""

    @property
    def supports_windows(self) -> bool:
        """Get whether the device has windows."""

    def configure_windows(self, *, prf_hz: float, settle_shots: int, on_advance: bool = False) -> None:
        """Set that records are taken in windows."""

    def take_windows(
        self, run_id: int, table: Sequence[Sequence[Window]], *, begin: Callable[[], None] | None = None
    ) -> Iterator[WindowRecord]:
        """Take one record for each row of the table; ``begin`` starts the path once the run waits."""


def can_window(galvo: Galvo, sampler: Sampler) -> bool:
    """Get whether these devices can take records in windows; they must be open."""
    return isinstance(galvo, PathGalvo) and isinstance(sampler, WindowSampler) and sampler.supports_windows


class WindowCapture:
    """Mode ``window``, ranged by the template estimator.

    The run id of a line is its row + 1, and the record number the column; points taken again are records of the run
    ``rows + row + 1``. A revisit is the last record of its line.

    Parameters
    ----------
    setup : Setup
        The calibration needs templates and the instant of the reference.
    columns : int
        Points in a line.

    Raises
    ------
    BadInput
        When the calibration lacks what windows need.
    """

    mode = "window"
    estimator: Method = "template"
    ranging: Ranging = "window"

    def __init__(self, setup: Setup, columns: int) -> None:
        settings = setup.settings
        self._setup = setup
        self._scanner = settings.scanner
        self._prf_hz = settings.pulser.prf_hz
        plan = PlanSettings(
            wanted_sd_mm=settings.scan.wanted_sd_mm,
            settle_shots=settings.scanner.window_settle_shots,
            free_shots=int(settings.scanner.window_settle_ms * 1e-3 * settings.pulser.prf_hz),
        )
        self._calibration = setup.calibration_for(self.ranging)
        self._planner = WindowPlanner(self._calibration, columns, plan)
        self._planner.line()  # makes the tables of the pulse shapes now, which takes a moment, and not under light

    @property
    def raw_bytes(self) -> int:
        """Get the most that the windows of a point take on the disk: all taken again, with wide windows."""
        (wide,) = self._planner.wide([0])
        return 2 * 2 * (wide.reference.samples + wide.echo.samples)

    @property
    def memory_s(self) -> float:
        """Get for how long a motion of the mirrors before a line shows in it: until it is below the last bit."""
        return FORGOTTEN_AFTER * self._scanner.flyback_settle_ms * 1e-3

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler that records are taken in windows, at the edges of its advance input."""
        _windows_of(sampler).configure_windows(
            prf_hz=self._prf_hz, settle_shots=self._scanner.window_settle_shots, on_advance=True
        )

    def times_s(self, columns: int) -> tuple[float, float]:
        """Get how long a revisit takes, and a line at least."""
        fly_s = self._scanner.window_flyback_ms * 1e-3
        free_s = 2 * self._scanner.window_settle_ms * 1e-3  # settling, and about as long on the echo
        return fly_s + REVISIT_S, fly_s + columns * free_s

    def state_dict(self) -> JsonObject:
        """Get what the next line is planned from."""
        return self._planner.state_dict()

    def load_state(self, state: JsonObject) -> None:
        """Plan on as if the lines before had just been taken."""
        self._planner.load_state(state)

    def take(self, plan: Plan, line: LinePlan, revisit: Revisit | None, devices: Devices) -> Captured:
        """Take a line in one path, and again those of its points whose echo was not in its window."""
        self._wait_for_frame()
        left_s = self._setup.clock.now()
        devices.galvo.move(int(line.lead_in[0]), int(line.lead_in[1]))  # settles while the line is planned and sent
        points = self._planner.line()
        targets = self._targets(line.codes, points)
        if revisit is not None:
            last = self._planner.monitor(revisit.echo_ps, revisit.response_mv)
            targets.append(_Target(revisit.codes, last, self._scanner.window_flyback_ms))
        records = self._take(_PathRun(line.row + 1, line.lead_in, targets, left_s), devices)
        windows = LineWindows.of(line.columns, records[: len(points)], _table(points), retaken=False)
        shots = _shots(points)
        ranges = range_windows(windows, self._calibration)
        lost = self._planner.lost(points, ranges)
        if lost.size:
            wide = self._planner.wide(lost)
            codes, left_s = line.codes[lost], self._setup.clock.now()
            again = self._take(
                _PathRun(plan.rows + line.row + 1, codes[0], self._targets(codes, wide), left_s), devices
            )
            shots += _shots(wide)
            retaken = LineWindows.of(line.columns[lost], again, _table(wide), retaken=True)
            windows = windows.followed_by(retaken)
            ranges = range_line(line.columns, windows, self._calibration)
        self._planner.learn(ranges)  # before the footprint is judged: half a spot on a rim is planned as it is seen
        return Captured(
            ranges=ranges,
            sweeps=max(point.echo.sweeps for point in points),
            shots=shots,
            revisit=None if revisit is None else self._ranges_of(records[-1], targets[-1].point),
            windows=windows,
        )

    def take_mark(self, run_id: int, mark: MarkPlan, devices: Devices) -> MarkRecords:
        """Take one record of the zero mark, in a path of its own."""
        left_s, point = self._setup.clock.now(), self._planner.mark(mark.range_mm)
        devices.galvo.move(int(mark.codes[0]), int(mark.codes[1]))
        target = _Target(mark.codes, point, self._scanner.window_flyback_ms)
        records = self._take(_PathRun(run_id, mark.codes, [target], left_s), devices)
        windows = LineWindows.of([0], records, _table([point]), retaken=False)
        return MarkRecords(None, windows, windows.clipped)

    def _wait_for_frame(self) -> None:
        """Begin at the same instant of a millisecond as every line: the phase of the USB frames.

        How long the mirrors have rested before they leave for this line then does not depend on when it is taken.
        """
        now_s = self._setup.clock.now()
        begin_s = (math.floor(now_s / FRAME_S) + FRAME_SHARE) * FRAME_S
        self._setup.clock.sleep(begin_s - now_s if begin_s >= now_s else begin_s + FRAME_S - now_s)

    def _targets(self, codes: IntArray, points: Sequence[PointWindows]) -> list[_Target]:
        settle_ms = self._scanner.window_settle_ms
        return [_Target(*target, settle_ms) for target in zip(codes, points, strict=True)]

    def _ranges_of(self, record: WindowRecord, point: PointWindows) -> Ranges:
        windows = LineWindows.of([0], [record], _table([point]), retaken=False)
        return range_windows(windows, self._calibration)

    def _take(self, run: _PathRun, devices: Devices) -> list[WindowRecord]:
        """Take one record at each target of a run."""
        galvo, sampler = devices.galvo, _windows_of(devices.sampler)
        if not isinstance(galvo, PathGalvo):
            raise BadInput("this galvo controller plays no paths; scan in mode sweep")
        devices.between()
        lead_s = max(0.0, self._scanner.window_flyback_ms * 1e-3 - (self._setup.clock.now() - run.left_s))
        path = plan_path(run.lead_in, lead_s, [self._stop(target) for target in run.targets])
        table = _table([target.point for target in run.targets])
        return list(sampler.take_windows(run.run_id, table, begin=lambda: galvo.play(*path)))

    def _stop(self, target: _Target) -> Stop:
        """Return the stop of a path at a target; the reference is taken while the mirrors settle."""
        settle_shots, point = self._scanner.window_settle_shots, target.point
        wait_s = max(0.0, target.settle_ms * 1e-3 - point.reference.shots(settle_shots) / self._prf_hz)
        return Stop(target.codes, wait_s, point.shots(settle_shots) / self._prf_hz)


class _Target(NamedTuple):
    """A point with its windows, and the least time from the step to it to the first shot on its echo."""

    codes: IntArray
    point: PointWindows
    settle_ms: float


@dataclass(frozen=True)
class _PathRun:
    """One path and one run of records; the mirrors have been on their way to the lead-in since ``left_s``."""

    run_id: int
    lead_in: IntArray
    targets: Sequence[_Target]
    left_s: float


def _windows_of(sampler: Sampler) -> WindowSampler:
    if not isinstance(sampler, WindowSampler):
        raise BadInput("this sampler takes no windows; scan in mode sweep")
    return sampler


def _table(points: Sequence[PointWindows]) -> list[tuple[Window, Window]]:
    return [(point.reference, point.echo) for point in points]


def _shots(points: Sequence[PointWindows]) -> int:
    return sum(point.shots(0) for point in points)
