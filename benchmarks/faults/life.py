"""One run of the controller with a fault: from connect to the end, watched from outside, judged against the truth."""

from __future__ import annotations

import signal
import sqlite3
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.faults.cases import Case
from benchmarks.faults.judge import judge
from benchmarks.faults.result import Result
from benchmarks.faults.watch import LightMeter, Seen
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import DeviceError
from picoradar.drivers.traces import CodeScale
from picoradar.instrument.acquisition import Setup, raster_scan
from picoradar.instrument.bench import Bench, make_bench
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import Controller, ScanOutcome
from picoradar.instrument.errors import PicoradarError
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording, from_sqlite
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import Fault, arm

ROWS = COLUMNS = 4
WALL_LIMIT_S = 60
SETTINGS = override(
    Settings(),
    {
        "diode": {"warm_up_limit_s": 120.0, "settle_limit_s": 20.0},
        "scan": {"rows": ROWS, "columns": COLUMNS},
        "simulation": {"target": "hip"},
    },
)


class Defect(Exception):
    """Stands for a failure of the program itself."""


class Hang(BaseException):
    """The run did not end within its bound."""


class Life:
    """Connect, warm up, scan, with a fault that strikes when the controller comes into a given state."""

    def __init__(self, case: Case, folder: Path) -> None:
        self.case = case
        self.clock = VirtualClock()
        self.bench = SimulatedBench({"target": "hip"}, seed=case.seed, clock=self.clock)
        self.meter = LightMeter(self.bench)
        self.errors: list[tuple[float, str]] = []
        self.off_s: list[float] = []
        real = make_bench(Links(**self.bench.urls), self.clock, self.bench.usb_backend)
        seen = {
            n: Seen(getattr(real, n), self.clock, self.errors, self.off_s)
            for n in ("pulser", "diode", "galvo", "sampler")
        }
        self.controller = Controller(Bench(clock=self.clock, **seen), SETTINGS)
        self.path = folder / f"{case.kind}-{case.link}-{case.state}-{case.seed}.db"
        self.acknowledged: list[int] = []
        self.outcome: ScanOutcome | None = None
        self.struck: Callable[[], float | None] = lambda: None
        self._rng = np.random.default_rng([case.seed, 1])
        self._spoil_append: Callable[[], None] | None = None

    def strike(self, after_s: float = 0.0) -> None:
        """Let the fault happen soon."""
        case, at_s = self.case, self.clock.now() + after_s
        if case.link == "host":
            self._strike_host(at_s)
            return
        fault = Fault(kind=case.kind, link=case.link, at={"time_s": at_s}, **case.lasting)
        strikes = arm(self.bench, [fault])[0]
        self.struck = lambda: strikes.first_s

    def _strike_host(self, at_s: float) -> None:
        def at_once() -> float | None:
            return at_s if self.clock.now() >= at_s else None

        self.struck = at_once
        if self.case.kind == "host_dead":
            arm(
                self.bench, [Fault(kind="deaf", link=link, at={"time_s": at_s}) for link in ("dg645", "genesys", "tec")]
            )
            arm(self.bench, [Fault(kind="usb_silent", link=link, at={"time_s": at_s}) for link in ("helios", "bridge")])
        elif self.case.kind.startswith("disk"):
            code = sqlite3.SQLITE_FULL if self.case.kind == "disk_full" else sqlite3.SQLITE_IOERR

            def fail() -> None:
                if self.clock.now() >= at_s:
                    error = sqlite3.OperationalError("injected")
                    error.sqlite_errorcode = code
                    raise from_sqlite(self.path, error, kept=len(self.acknowledged))

            self._spoil_append = fail
        elif self.case.kind == "host_stuck":
            self.clock.call_at(at_s, lambda: self._stuck_until(at_s + 5.0))
        else:
            self._sink_error_at_s = at_s

    columns = COLUMNS
    _sink_error_at_s = float("inf")

    def _stuck_until(self, moment: float) -> None:
        """Time passes and the host does nothing: its own timer, the heartbeat, does not run either."""
        supervisor = self.controller._supervisor
        timer = supervisor._timer
        if timer is not None:
            timer.cancel()
        self.clock.advance_to(moment)

    def live(self) -> None:
        """Go through the states."""
        case, controller = self.case, self.controller
        if case.state == "off":
            self.strike()
        controller.connect()
        if case.state == "connected":
            self.strike()
        if case.state == "fault":
            controller.emergency_off()
            self.strike()
            controller.acknowledge()
            controller.connect()
        if case.state == "warming":
            self.strike(after_s=5.0)
        controller.warm_up()
        if case.state == "ready":
            self.strike()
        self._scan()

    def _scan(self) -> None:
        job = raster_scan(Setup(SETTINGS, calibration_of(SETTINGS), self.clock))
        sampler = self.controller.bench.sampler
        header = job.header({}, seed=self.case.seed, scale=CodeScale(sampler.zero_code, sampler.mv_per_code))
        with Recording.create(self.path, header) as recording:
            store = Store(recording, self)
            self.outcome = self.controller.scan(job, store, [self._sink])

    def _sink(self, _line: ScanLine) -> None:
        state = self.case.state
        if self.case.kind == "sink_fails" and self.clock.now() >= self._sink_error_at_s:
            raise RuntimeError("injected: a viewer fails")
        if len(self.acknowledged) != 1:
            return
        if state == "scanning":
            self.strike(after_s=float(self._rng.random()))
        elif state == "paused":
            self.controller.request("pause")
            self.clock.call_at(self.clock.now() + 1.5, self.strike)
            self.clock.call_at(self.clock.now() + 4.0, lambda: self.controller.request("resume"))
        elif state == "suspended":
            begin = self.clock.now() + 0.1
            arm(self.bench, [Fault(kind="unplugged", link="tec", at={"time_s": begin}, lasts_s=4.0)])
            self.clock.call_at(begin + 2.5, self.strike)


class Store:
    """The recording, with a disk that may fail and a program that may be broken."""

    def __init__(self, recording: Recording, life: Life) -> None:
        self._recording = recording
        self._life = life
        self.path = recording.path

    def append(self, line: ScanLine, *, acknowledged_at_s: float | None = None) -> None:
        self._fail()
        self._recording.append(line, acknowledged_at_s=acknowledged_at_s)
        self._life.acknowledged.append(line.index)

    def event(self, time_s: float, kind: str, *, state: str | None = None, **fields: object) -> None:
        self._fail()
        self._recording.event(time_s, kind, state=state, **fields)

    def finish(self, stop_reason: str, *, laser_off_verified: bool, **summary: object) -> bool:
        self._fail()
        return self._recording.finish(stop_reason, laser_off_verified=laser_off_verified, **summary)

    def _fail(self) -> None:
        if self._life._spoil_append is not None:
            self._life._spoil_append()
        if self._life.case.kind == "defect" and self._life.clock.now() >= self._life._sink_error_at_s:
            raise Defect("injected: the program fails")


def run(case: Case, folder: Path) -> Result:
    """Carry out one case."""
    result = Result(case)
    life = Life(case, folder)
    before = signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(WALL_LIMIT_S)
    try:
        life.live()
    except (PicoradarError, DeviceError, Defect) as error:
        result.cause = f"{type(error).__name__}: {error}"
    except Hang:
        result.defect = "hang"
    except Exception:  # noqa: BLE001 - whatever it is, it is a result: a defect
        result.defect = traceback.format_exc(limit=-3)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    judge(result, life)
    life.bench.close()
    return result


def _too_long(_number: int, _frame: Any) -> None:
    raise Hang
