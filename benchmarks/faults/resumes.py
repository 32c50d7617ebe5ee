"""kill -9 after every line of a scan, resume, and compare with the scan that was not killed, byte for byte.

python -m benchmarks.faults.resumes                               20 x 20 in windows, 5 seeds: 100 kills
python -m benchmarks.faults.resumes --grid 8x40 --mode sweep --seeds 1
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.faults.kills import content, quiet
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording


def in_a_process(work: Callable[[], int]) -> int:
    """Do work in a process of its own; returns its exit status, negative for a signal."""
    child = os.fork()
    if child == 0:
        os._exit(work())
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def scan_until(lines: int, arguments: list[str]) -> int:
    """Scan in this process, and kill it as soon as so many lines are durable."""
    append = Recording.append
    stored = 0

    def append_and_die(self: Recording, line: ScanLine, *, acknowledged_at_s: float | None = None) -> None:
        nonlocal stored
        append(self, line, acknowledged_at_s=acknowledged_at_s)
        stored += 1
        if stored == lines:
            os.kill(os.getpid(), signal.SIGKILL)

    Recording.append = append_and_die  # type: ignore[method-assign]
    return quiet(arguments)


def campaign(grid: str, mode: str, seed: int) -> list[bool]:
    """Kill after each line; returns for each whether the resumed scan is the same."""
    same = []
    with tempfile.TemporaryDirectory() as name:
        scan = ["scan", "--grid", grid, "--mode", mode, "--seed", str(seed), "--json", "-o"]
        whole = Path(name) / "whole.db"
        if in_a_process(lambda: quiet([*scan, str(whole)])):
            raise RuntimeError("the scan without interruption failed")
        wanted = content(whole)
        for lines in range(1, int(grid.split("x")[0]) + 1):
            path = Path(name) / f"{lines}.db"
            killed = in_a_process(lambda path=path, lines=lines: scan_until(lines, [*scan, str(path)]))  # type: ignore[misc]
            if killed != -signal.SIGKILL:
                raise RuntimeError(f"the scan ended by itself before line {lines}: {killed}")
            resumed = in_a_process(lambda path=path: quiet(["resume", str(path), "--json"]))  # type: ignore[misc]
            same.append(resumed == 0 and content(path) == wanted)
    return same


def main() -> int:
    """Print a line a seed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", default="20x20")
    parser.add_argument("--mode", default="window")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    chosen = parser.parse_args()
    kills = equal = 0
    for seed in chosen.seeds:
        same = campaign(chosen.grid, chosen.mode, seed)
        kills, equal = kills + len(same), equal + sum(same)
        different = [line for line, whether in enumerate(same, 1) if not whether]
        print(
            f"{chosen.mode} {chosen.grid}, seed {seed}: {sum(same)} of {len(same)} the same; not after {different}",
            flush=True,
        )
    print(f"{equal} of {kills}")
    return 0 if equal == kills else 1


if __name__ == "__main__":
    sys.exit(main())
