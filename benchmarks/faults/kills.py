"""kill -9 at random instants of a scan: every line that was acknowledged is there, and the resumed scan is identical.

python -m benchmarks.faults.kills --kills 200
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import random
import signal
import sqlite3
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from picoradar.instrument.cli.main import run
from picoradar.instrument.line import LAST_ECHO
from picoradar.instrument.recording import Recording, RecordingError

SCAN = ["scan", "--grid", "8x8", "--seed", "4", "--speed", "60", "--json"]


def content(path: Path) -> bytes:
    """Get all that a scan is about as bytes: raw traces or windows, points, covariance, flags."""
    with Recording.open(path) as recording:
        lines = list(recording.lines())
        traces = b"".join(line.sums.tobytes() for line in lines if line.sums is not None)
        traces += b"".join(line.windows.sums.tobytes() for line in lines if line.windows is not None)
        cloud = recording.cloud()
    names = (
        *("points_mm", "covariance_mm2", "range_mm", "range_variance_mm2", "response_mv", "flags", "rows", "columns"),
        *LAST_ECHO,
    )
    return traces + b"".join(np.ascontiguousarray(getattr(cloud, name)).tobytes() for name in names)


def quiet(arguments: list[str]) -> int:
    """Run the command in this process without its output."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        return run(arguments)


def acknowledged(path: Path) -> list[int]:
    """Read, from outside, which lines are in the file now."""
    with contextlib.suppress(RecordingError, sqlite3.Error), Recording.open(path) as recording:
        return recording.done
    return []


def kill_one(path: Path, wait_s: float) -> list[int]:
    """Scan in a child process, kill it after a while, and say which lines were seen in the file before."""
    child = os.fork()
    if child == 0:
        os._exit(quiet([*SCAN, "-o", str(path)]))
    end = time.monotonic() + 60
    while not (seen := acknowledged(path)) and time.monotonic() < end:
        time.sleep(0.01)
    time.sleep(wait_s)
    seen = acknowledged(path) or seen
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return seen


def main() -> int:
    """Kill, resume, compare, as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    lost = different = interrupted = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole = folder / "whole.db"
        if quiet([*SCAN, "--speed", "max", "-o", str(whole)]):
            raise SystemExit("the scan without interruption failed")
        wanted = content(whole)
        for number in range(chosen.kills):
            path = folder / f"{number}.db"
            seen = kill_one(path, rng.uniform(0.0, 0.2))
            with Recording.open(path) as recording:
                sound = [check.index for check in recording.check() if check.ok]
                complete = recording.complete
            lost += len(set(seen) - set(sound))
            if not complete:
                interrupted += 1
                if quiet(["resume", str(path), "--json"]):
                    raise SystemExit(f"kill {number}: the scan does not go on")
            different += content(path) != wanted
            path.unlink()
            if number % 20 == 19:
                print(
                    f"{number + 1} kills, {interrupted} in mid-scan, {lost} lines lost, {different} different",
                    flush=True,
                )
    print(
        f"{chosen.kills} kills, {interrupted} in mid-scan: {lost} acknowledged lines lost, {different} scans different"
    )
    return 1 if lost or different else 0


if __name__ == "__main__":
    sys.exit(main())
