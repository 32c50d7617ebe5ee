"""A program that brings a radar into a state, says so on stdout, and waits there for what `endings` does to it.

It uses the session of the command, so that it ends as `picoradar scan` does: same signals, same exit status.
"""

from __future__ import annotations

import _thread
import os
import resource
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from picoradar.drivers.traces import CodeScale
from picoradar.instrument.acquisition import Setup, raster_scan
from picoradar.instrument.cli import main as command
from picoradar.instrument.cli import session as sessions
from picoradar.instrument.cli import signals, streams
from picoradar.instrument.errors import Interrupted
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import load_settings, override

HOLD_S = 6.0
MEGABYTE = 2**20


def say(state: str) -> None:
    """Tell the campaign where the radar is."""
    os.write(3, f"{state}\n".encode())


def hold(run: sessions.Session, state: str, wanted: str) -> None:
    """Stay in a state for a while, if it is the wanted one, as a program does that waits for a person."""
    if state == wanted:
        say(state)
        end = run.controller.bench.clock.now() + HOLD_S
        run.controller.rest(lambda: run.controller.bench.clock.now() >= end)


def fail(_line: ScanLine) -> NoReturn:
    """Fail as a viewer does that has a defect."""
    raise RuntimeError("a defect of a viewer")


def out_of_memory(job: Any) -> None:
    """Let the ranging of the next line find no memory any more."""
    take = job.take_line

    def take_without_memory(row: int, *devices: Any) -> ScanLine:
        if row == 1:
            with open("/proc/self/statm", encoding="ascii") as statm:
                pages = int(statm.read().split()[0])
            limit = pages * resource.getpagesize() + 20 * MEGABYTE
            resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
            try:
                np.ones(100 * MEGABYTE)
            finally:
                resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        line: ScanLine = take(row, *devices)
        return line

    job.take_line = take_without_memory


def bad_estimator(job: Any) -> None:
    """Let the estimator of the next line fail."""
    take = job.take_line

    def take_badly(row: int, *devices: Any) -> ScanLine:
        if row == 1:
            raise ZeroDivisionError("a defect of an estimator")
        line: ScanLine = take(row, *devices)
        return line

    job.take_line = take_badly


def scan(run: sessions.Session, path: Path, wanted: str, way: str) -> None:
    """Scan, and be in the wanted state on the way."""
    controller = run.controller
    job = raster_scan(Setup(run.settings, run.calibration, controller.bench.clock))
    {"memory": out_of_memory, "estimator": bad_estimator}.get(way, lambda _: None)(job)

    def provoke(line: ScanLine) -> None:
        if line.index == 0 and wanted in ("scanning", "shutdown"):
            say(wanted) if wanted == "scanning" else controller.request("finish")
        elif line.index == 0 and wanted == "paused":
            controller.request("pause")
            threading.Timer(3.0, lambda: say(wanted)).start()
            threading.Timer(3.0 + HOLD_S, lambda: controller.request("resume")).start()
        elif line.index == 0 and wanted == "suspended":
            (Path(sys.argv[1]).parent / "cut").touch()
            threading.Timer(2.5, lambda: say(wanted)).start()

    if wanted == "shutdown":
        _slow(controller.bench.galvo, lambda: say(wanted))
    sinks = [provoke, *([fail] if way == "sink" else [])]
    header = job.header(run.identities, seed=None, scale=CodeScale(32.0, 0.5))
    with Recording.create(path, header) as recording:
        outcome = controller.scan(job, recording, sinks)
    os.write(4, f"{outcome.stop_reason}; {outcome.safe}; {outcome.sinks}\n".encode())
    if outcome.stop_reason == "interrupted":
        raise Interrupted(f"interrupted; {outcome.safe}")


def _slow(galvo: Any, before: Callable[[], None]) -> None:
    """Let the safe shutdown take a second in the middle, so that it can be disturbed."""
    park = galvo.park

    def park_slowly() -> None:
        before()
        threading.Event().wait(1.0)
        park()

    galvo.park = park_slowly


def work(settings_file: Path, path: Path, wanted: str, way: str) -> None:
    """Go through the states; hold in the wanted one."""
    settings = override(load_settings(settings_file), {"scan": {"rows": 4, "columns": 8}})
    if way == "thread":
        threading.Thread(target=_interrupt_when_told, daemon=True).start()
    with sessions.session(settings, None) as run:
        hold(run, "connected", wanted)
        if wanted == "warming":
            threading.Timer(0.3, lambda: say(wanted)).start()
        sessions.warm_up(run)
        hold(run, "ready", wanted)
        if wanted == "fault":
            run.controller.emergency_off()
            hold(run, "fault", wanted)
            return
        scan(run, path, wanted, way)


def _interrupt_when_told() -> None:
    sys.stdin.readline()
    _thread.interrupt_main()


def main() -> int:
    """Run as the command does, with its handlers and its exit status."""
    streams.make_tolerant()
    signals.interrupt_from_now_on()
    settings, path, wanted, way = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4]
    try:
        work(settings, path, wanted, way)
    except KeyboardInterrupt:
        return 130
    except Exception as error:  # noqa: BLE001 - as the command, which turns every failure into an exit status
        os.write(4, f"{type(error).__name__}: {error}\n".encode())
        status = command.exit_status(error)
        return 1 if status is None else status
    finally:
        signals.ignore_from_now_on()
    return 0


if __name__ == "__main__":
    sys.exit(main())
