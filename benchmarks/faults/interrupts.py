"""Raise an exception at every line that the controller executes in a scan, once and twice in a row; see the light.

python -m benchmarks.faults.interrupts                      a table: once, twice
python -m benchmarks.faults.interrupts --times 3 --exception MemoryError --seed 2

A program without the command's signal handlers (a notebook, a script of a laboratory) can be interrupted between any
two instructions. The observer of the light is in the simulated bench and knows nothing of the controller.
"""

from __future__ import annotations

import argparse
import builtins
import io
import logging
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import picoradar.instrument.controller
from benchmarks.faults.watch import LightMeter
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.traces import CodeScale
from picoradar.instrument import events
from picoradar.instrument.acquisition import Setup, raster_scan
from picoradar.instrument.bench import make_bench
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import Controller
from picoradar.instrument.controller.safety import VERIFIED
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import Fault, arm

ROOM = str(Path(picoradar.instrument.controller.__file__).parent)
DARK_LIMIT_S = 1.1  # the bridge's watchdog, and one poll of the observer
AFTERWARDS_S = 60.0
LOW_V = 1.0  # the supply's output counts as off
Line = tuple[str, int]


class Tracer:
    """Counts the lines of the controller as they are executed, and raises at chosen ones.

    Parameters
    ----------
    at : int, optional
        Number of the executed line at which to raise first.
    times : int
        How often in a row, at one executed line after the other.
    kind : type
        The exception.
    """

    def __init__(self, at: int | None = None, times: int = 1, kind: type[BaseException] = KeyboardInterrupt) -> None:
        self.executed: list[Line] = []
        self.raised_at: list[Line] = []
        self._at, self._times, self._kind = at, times, kind

    def __enter__(self) -> Tracer:
        self._before = sys.gettrace()  # a measurement of coverage, for one
        sys.settrace(self._call)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(self._before)

    def _call(self, frame: FrameType, _event: str, _: object) -> Any:
        return self._line if frame.f_code.co_filename.startswith(ROOM) else None

    def _line(self, frame: FrameType, event: str, _: object) -> Any:
        if event != "line":
            return self._line
        here = (Path(frame.f_code.co_filename).name, frame.f_lineno)
        number = len(self.executed)
        self.executed.append(here)
        if self._at is not None and number >= self._at and len(self.raised_at) < self._times:
            self.raised_at.append(here)
            raise self._kind
        return self._line


@dataclass
class Outcome:
    """What the observer and the controller say after one interrupted scan.

    Attributes
    ----------
    raised_at : list of (str, int)
        File and line of each exception.
    dark, barriers_closed : bool
        By the observer: no light from the return of the scan on; triggers stopped and no voltage as well.
    said : bool
        By the controller: laser off verified, with a cause, and a barrier that is not closed named as such.
    state : str
    shut_down : bool
        Whether `shut_down` was allowed and led to ``off``, by way of `acknowledge` after a fault.
    """

    raised_at: list[Line]
    dark: bool
    barriers_closed: bool
    said: bool
    state: str
    shut_down: bool

    @property
    def sound(self) -> bool:
        """Get whether nothing is left to wish for."""
        left = self.state in ("fault", "ready")
        return self.dark and self.said and left and self.shut_down


class Radar:
    """A simulated bench that scans two lines with a pause after the first and a lost link in the second."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.settings = override(Settings(), {"scan": {"rows": 2, "columns": 2}, "": {"seed": seed}})
        self.clock = VirtualClock()
        self.sim = SimulatedBench({"target": "plate"}, seed=seed, clock=self.clock)
        self.controller = Controller(
            make_bench(Links(**self.sim.urls), self.clock, self.sim.usb_backend), self.settings
        )
        self.meter = LightMeter(self.sim)
        self._folder, self._scans = folder, 0

    def scan(self, tracer: Tracer) -> Outcome:
        """Scan under the tracer; look at the light when it has ended, and a minute later."""
        controller, clock = self.controller, self.clock
        if controller.state == "off":
            controller.connect()
            controller.warm_up()
        self._scans += 1
        job = raster_scan(Setup(self.settings, calibration_of(self.settings), clock))
        header = job.header({}, seed=self.settings.seed, scale=CodeScale(32.0, 0.5))
        with Recording.create(self._folder / f"{self._scans}.db", header) as recording:
            try:
                with tracer:
                    controller.scan(job, recording, [self._provoke])
            except (KeyboardInterrupt, MemoryError, SystemExit):
                pass
        lit = self.meter.is_lit()
        state, safe = controller.state, controller.safe
        ended_s = clock.now()
        clock.sleep(AFTERWARDS_S)
        dark = not lit and not self.meter.is_lit() and all(end - ended_s < DARK_LIMIT_S for _, end in self.meter.times)
        closed = self.sim.trigger.rate_hz == 0 and self.sim.genesys.output_v() < LOW_V
        said = safe.laser_off_verified and (state == "ready" or bool(controller.cause))
        said = said and (closed or safe.steps["pulser"] != VERIFIED)  # its cable may be out when the interrupt comes
        return Outcome(tracer.raised_at, dark, closed, said, state, self._leave())

    def _provoke(self, line: ScanLine) -> None:
        if line.index == 0:
            self.controller.request("pause")
            self.clock.call_at(self.clock.now() + 1.0, lambda: self.controller.request("resume"))
        unplugged = {"kind": "unplugged", "link": "dg645", "at": {"time_s": self.clock.now() + 2.0}, "lasts_s": 0.5}
        arm(self.sim, [Fault.model_validate(unplugged)])

    def _leave(self) -> bool:
        """Shut down, from whatever state; returns whether that is allowed and leads out of it."""
        controller = self.controller
        for _ in range(2):  # the first, in mid-scan, is an emergency off
            controller.shut_down()
        if controller.state == "fault":
            controller.acknowledge()
        return controller.state == "off"


def moments(executed: list[Line], seed: int) -> Iterator[int]:
    """Choose the first execution of every line, and another one where there is any."""
    rng = np.random.default_rng(seed)
    where: dict[Line, list[int]] = {}
    for number, line in enumerate(executed):
        where.setdefault(line, []).append(number)
    for numbers in where.values():
        yield numbers[0]
        if len(numbers) > 1:
            yield int(rng.choice(numbers[1:]))


def campaign(times: int, kind: type[BaseException], seed: int, most: int | None = None) -> list[Outcome]:
    """Interrupt one scan after the other, each at another line.

    Parameters
    ----------
    times : int
        Exceptions in a row.
    kind : type
        The exception.
    seed : int
        Of the bench, and of the choice among the executions of a line.
    most : int, optional
        Only so many of the lines, evenly chosen.
    """
    with tempfile.TemporaryDirectory() as folder:
        radar = Radar(Path(folder), seed)
        untouched = Tracer()
        if not radar.scan(untouched).sound:
            raise RuntimeError("the scan is not sound without any interrupt")
        chosen = list(moments(untouched.executed, seed))
        if most is not None:
            chosen = chosen[:: max(1, len(chosen) // most)]
        found = [radar.scan(Tracer(at, times, kind)) for at in chosen]
        radar.sim.close()
    return found


def main() -> int:
    """Print a table; exit 1 when anything was left to wish for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, nargs="+", default=[1, 2], help="exceptions in a row")
    parser.add_argument("--exception", default="KeyboardInterrupt", help="KeyboardInterrupt, MemoryError or SystemExit")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    events.configure(logging.CRITICAL, io.StringIO())
    failed = 0
    print("| in a row | scans | lines | dark | barriers closed | said | state scanning | sound |")
    print("|---|---|---|---|---|---|---|---|")
    for times in chosen.times:
        found = campaign(times, getattr(builtins, chosen.exception), chosen.seed)
        lines = len({outcome.raised_at[0] for outcome in found if outcome.raised_at})
        sums = [sum(getattr(o, name) for o in found) for name in ("dark", "barriers_closed", "said", "sound")]
        scanning = sum(o.state not in ("fault", "ready") for o in found)
        print(
            f"| {times} | {len(found)} | {lines} | {sums[0]} | {sums[1]} | {sums[2]} | {scanning} | {sums[3]} |",
            flush=True,
        )
        for outcome in found:
            if not outcome.sound:
                failed += 1
                print(f"  {outcome}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
