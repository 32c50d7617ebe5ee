"""Endurance: hours of device time on one bench, or thousands of connections; memory and open files must stay flat.

python -m benchmarks.faults.endurance --hours 24          scanning again and again
python -m benchmarks.faults.endurance --connections 10000
python -m benchmarks.faults.endurance --hours 8 --viewers --averages 8    each scan with a viewer that stalls and dies
python -m benchmarks.faults.endurance --scans 200 --viewers --mode window
"""

from __future__ import annotations

import argparse
import gc
import io
import logging
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.traces import CodeScale
from picoradar.instrument import events
from picoradar.instrument.acquisition import Setup, raster_scan
from picoradar.instrument.bench import make_bench
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import Controller, Subscription
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench

SMALL: dict[str, object] = {"rows": 10, "columns": 10, "averages": 32, "keep_traces": False}
STALL_S = 0.05  # of wall time, in each line: longer than a simulated line takes
MEMORY_MB = 8.0  # growth after the first tenth that still counts as flat
REPORTS = 10


class ThreadedClock(VirtualClock):
    """Virtual time, on which sinks run in threads as on a real clock."""

    real_time = True


class Viewers:
    """One that must see all lines, and one that connects anew for each scan, stalls, and dies."""

    def __init__(self) -> None:
        self.seen = self.died = 0

    def subscriptions(self) -> list[Subscription]:
        """Return those of the next scan."""
        return [Subscription(self._count, "count", every_line=True), Subscription(self._die, "viewer")]

    def _count(self, _line: ScanLine) -> None:
        self.seen += 1

    def _die(self, line: ScanLine) -> None:
        time.sleep(STALL_S)
        if line.index > 1:
            self.died += 1
            raise ConnectionResetError("the viewer has gone")


class LongRun:
    """One bench and one controller, used for a long time."""

    def __init__(self, folder: Path, scan: dict[str, object], *, viewers: bool = False) -> None:
        events.configure(logging.CRITICAL, io.StringIO())
        self.settings = override(Settings(), {"scan": scan})
        self.folder = folder
        self.clock = ThreadedClock() if viewers else VirtualClock()
        self.viewers = Viewers() if viewers else None
        self.sim = SimulatedBench({"target": "plate"}, seed=1, clock=self.clock)
        self.bench = make_bench(Links(**self.sim.urls), self.clock, self.sim.usb_backend)
        self.controller = Controller(self.bench, self.settings)
        self.scans = self.lines = 0

    def get_ready(self) -> None:
        self.controller.connect()
        self.controller.warm_up()

    def scan(self) -> None:
        """Scan once into a recording, read it back, and take it away."""
        setup = Setup(self.settings, calibration_of(self.settings), self.clock)
        job = raster_scan(setup, in_windows=self.settings.scan.mode == "window")
        sinks = self.viewers.subscriptions() if self.viewers else []
        path = self.folder / "scan.db"
        with Recording.create(path, job.header({}, seed=1, scale=CodeScale(32.0, 0.5))) as recording:
            outcome = self.controller.scan(job, recording, sinks)
        if outcome.stop_reason != "complete" or not outcome.safe.complete:
            raise SystemExit(f"scan {self.scans}: {outcome.stop_reason}; {outcome.safe}")
        with Recording.open(path) as recording:
            self.lines += sum(line.ok for line in recording.check())
        if self.viewers and self.viewers.seen != self.lines:
            raise SystemExit(f"scan {self.scans}: {self.viewers.seen} lines handed on of {self.lines}")
        path.unlink()
        self.scans += 1
        self.sim.optics.truth.clear()  # the bench remembers the truth of every record for ever

    def connect_and_leave(self) -> None:
        """Open all links and close them again."""
        self.controller.connect()
        safe = self.controller.shut_down()
        if not safe.laser_off_verified:
            raise SystemExit(str(safe))
        self.scans += 1


def resident_mb() -> float:
    """Get the memory of this process."""
    gc.collect()
    with open("/proc/self/statm", encoding="ascii") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def open_files() -> int:
    """Get the number of open files of this process."""
    return len(os.listdir("/proc/self/fd"))


def watched(step: Callable[[], None], share: Callable[[], float]) -> tuple[float, int]:
    """Repeat a step until ``share()`` reaches 1; return the growth of memory (MB) and open files after a tenth."""
    began, reported = time.perf_counter(), 0
    base: tuple[float, int] | None = None
    while (done := share()) < 1.0:
        step()
        if done * REPORTS >= reported:
            reported += 1
            now = resident_mb(), open_files()
            base = now if done >= 0.1 and base is None else base
            print(f"{done:5.0%} {now[0]:7.1f} MB {now[1]:3d} files {time.perf_counter() - began:6.0f} s", flush=True)
    first = base or (resident_mb(), open_files())
    return resident_mb() - first[0], open_files() - first[1]


def endure(
    folder: Path,
    *,
    hours: float = 0.0,
    connections: int = 0,
    scans: int = 0,
    viewers: bool = False,
    **scan: object,
) -> tuple[float, int, LongRun]:
    """Run for so many hours of device time, so many connections, or so many scans with these settings."""
    run = LongRun(folder, {**SMALL, **scan}, viewers=viewers)
    if scans:
        run.get_ready()
        growth = watched(run.scan, lambda: run.scans / scans)
    elif connections:
        growth = watched(run.connect_and_leave, lambda: run.scans / connections)
    else:
        run.get_ready()
        begin_s = run.clock.now()
        growth = watched(run.scan, lambda: (run.clock.now() - begin_s) / (3600.0 * hours))
    run.sim.close()
    return *growth, run


def main() -> int:
    """Run and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--connections", type=int, default=0)
    parser.add_argument("--scans", type=int, default=0)
    parser.add_argument("--viewers", action="store_true", help="sinks in threads; one of them stalls and dies")
    parser.add_argument("--mode", default="sweep")
    parser.add_argument("--averages", type=int, default=32)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        grown_mb, grown_files, run = endure(
            Path(folder),
            hours=chosen.hours,
            connections=chosen.connections,
            scans=chosen.scans,
            viewers=chosen.viewers,
            mode=chosen.mode,
            averages=chosen.averages,
        )
    flat = grown_mb <= MEMORY_MB and grown_files <= 0
    print(
        f"{run.clock.now() / 3600:.2f} h of device time, {run.scans} rounds, {run.lines} lines read back; "
        f"memory {grown_mb:+.1f} MB, open files {grown_files:+d}: {'flat' if flat else 'GROWS'}"
    )
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
