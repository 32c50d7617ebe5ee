"""A scan at speed 1 with viewers that sleep, raise and hang, beside the same scan alone: what they cost in device time.

python -m benchmarks.faults.viewers                 8 lines of 20 points; a sink sleeps 5 s in each line
"""

from __future__ import annotations

import argparse
import io
import logging
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, NoReturn

from picoradar.drivers.clock import ScaledClock
from picoradar.drivers.traces import CodeScale
from picoradar.instrument import events
from picoradar.instrument.acquisition import Setup, raster_scan
from picoradar.instrument.bench import make_bench
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import Controller, ScanOutcome, Subscription
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Settings, load_settings, override


class Compared(NamedTuple):
    """A scan alone, the same with viewers, and the lines that a consumer has seen that must see all."""

    alone: ScanOutcome
    watched: ScanOutcome
    seen: list[int]


@contextmanager
def served(folder: Path, speed: float) -> Iterator[Settings]:
    """Serve a bench in a process of its own; get the settings that reach it."""
    command = [sys.executable, "-m", "picoradar.instrument.cli", "sim", "--speed", f"{speed:g}", "--target", "plate"]
    process = subprocess.Popen([*command, "--out", str(folder)], stdout=subprocess.PIPE, text=True)
    try:
        if process.stdout is None or not process.stdout.readline():
            raise RuntimeError("the bench does not begin")
        yield load_settings(folder / "settings.toml")
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate()


def compare(settings: Settings, folder: Path, sleep_s: float) -> Compared:
    """Scan twice over the links of the settings: alone, and with viewers of which one sleeps so long in each line."""
    seen: list[int] = []
    controller = Controller(make_bench(settings.links, ScaledClock(settings.links.speed)), settings)

    def slow(_line: ScanLine) -> None:
        time.sleep(sleep_s)

    def broken(_line: ScanLine) -> NoReturn:
        raise RuntimeError("no display")

    def hung(_line: ScanLine) -> None:
        threading.Event().wait()

    def scan(name: str, sinks: list[Subscription]) -> ScanOutcome:
        job = raster_scan(Setup(settings, calibration_of(settings), controller.bench.clock))
        header = job.header({}, seed=1, scale=CodeScale(32.0, 0.5))
        with Recording.create(folder / f"{name}.db", header) as recording:
            return controller.scan(job, recording, sinks)

    controller.connect()
    controller.warm_up()
    scan("first", [])  # loads what the ranging needs, which takes the first lines of a program longer
    alone = scan("alone", [])
    every_line = {"slow": slow, "hung": hung, "list": lambda line: seen.append(line.index)}
    sinks = [Subscription(sink, name, every_line=True) for name, sink in every_line.items()]
    watched = scan("watched", [*sinks, Subscription(broken, "broken")])
    controller.shut_down()
    return Compared(alone, watched, seen)


def main() -> int:
    """Print both, and exit 1 when the viewers cost more than 2 %."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--rows", type=int, default=8)
    parser.add_argument("--columns", type=int, default=20)
    parser.add_argument("--sleep", type=float, default=5.0, help="wall time that a sink sleeps in each line, s")
    chosen = parser.parse_args()
    events.configure(logging.CRITICAL, io.StringIO())
    with tempfile.TemporaryDirectory() as name, served(Path(name), chosen.speed) as reached:
        settings = override(reached, {"scan": {"rows": chosen.rows, "columns": chosen.columns}})
        alone, watched, seen = compare(settings, Path(name), chosen.sleep)
    more = watched.device_time_s / alone.device_time_s - 1
    print(f"alone {alone.device_time_s:.2f} s; with viewers {watched.device_time_s:.2f} s ({more:+.1%})")
    print(f"{watched.stop_reason}, {watched.lines} lines, {len(seen)} seen by who must see all; sinks: {watched.sinks}")
    return 0 if more <= 0.02 and watched.stop_reason == "complete" and len(seen) == chosen.rows else 1


if __name__ == "__main__":
    sys.exit(main())
