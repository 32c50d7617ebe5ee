"""Every way in which a program can end, in every state of the controller, at speed 1, seen by the bench itself.

python -m benchmarks.faults.endings                      a table, one line a way: some fifteen minutes
python -m benchmarks.faults.endings --ways SIGHUP SIGKILL --states scanning
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from picoradar.instrument.recording import Recording, RecordingError

STATES = ("connected", "warming", "ready", "scanning", "paused", "suspended", "fault", "shutdown")
SIGNALS = ("SIGINT", "SIGINT twice", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGSTOP", "SIGKILL", "thread", "stdout")
DEFECTS = ("sink", "estimator", "memory")  # in mid-scan only
DARK_LIMIT_S = 1.1
STOPPED_S = 3.0
MOMENT_S = 0.25
LONGEST_S = 60.0


@dataclass(frozen=True)
class Ended:
    """What came of one program.

    Attributes
    ----------
    dark_s : float
        From the event to the last light that the bench saw.
    left : tuple of str
        Barriers that were not closed at the end; after SIGKILL before ``picoradar off``.
    after_off : tuple of str
        The same after it.
    said : bool
        Whether the program said that the laser is verified off, or that it is not.
    """

    way: str
    state: str
    status: int
    dark_s: float
    left: tuple[str, ...]
    after_off: tuple[str, ...]
    said: bool
    words: str

    @property
    def told_left(self) -> bool:
        """Get whether the program named the device that it could not reach: in ``suspended`` its cable is out."""
        return self.state == "suspended" and "pulser: DG645" in self.words and "gate" not in self.left

    @property
    def sound(self) -> bool:
        """Get whether this is what docs/safety.md promises."""
        if self.dark_s > DARK_LIMIT_S or self.after_off:
            return False
        if self.way == "SIGKILL":
            return "gate" not in self.left
        if not self.said or (self.left and not self.told_left):
            return False
        return self.status == 130 if self.way.startswith(("SIGINT", "SIGT", "SIGH", "SIGQ", "thread")) else True


@contextmanager
def bench(folder: Path) -> Iterator[None]:
    """Serve a bench with its observer in a process of its own."""
    served = subprocess.Popen([sys.executable, "-m", "benchmarks.faults.ending_bench", str(folder)])
    try:
        _wait_for(lambda: (folder / "ready").exists(), "the bench does not begin")
        yield
    finally:
        (folder / "stop").touch()
        served.wait(LONGEST_S)


def one(way: str, state: str) -> Ended:
    """End one program in one way, in one state."""
    with tempfile.TemporaryDirectory() as name, bench(Path(name)):
        folder = Path(name)
        settings, recording = str(folder / "settings.toml"), folder / "scan.db"
        told, tell = os.pipe()
        words, speak = os.pipe()
        program = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3>&{tell} 4>&{speak}', "-", sys.executable, "-m",
             "benchmarks.faults.ending_program", settings, str(recording), state, way],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, pass_fds=(tell, speak),
            start_new_session=True,
        )  # fmt: skip
        os.close(tell)
        os.close(speak)
        reached = os.read(told, 100).decode().strip()
        time.sleep(MOMENT_S)  # into a record, when it scans
        event_s = time.monotonic()
        if reached == state:
            _do(way, program)
        _, error = program.communicate(timeout=LONGEST_S)
        text = error.decode() + os.read(words, 100_000).decode()
        time.sleep(1.5)  # the watchdog of a program that could not say anything
        seen = _seen(folder)
        dark_s = max((entry["at_s"] - event_s for entry in seen if entry["lit"]), default=0.0)
        expected_to_go_on = way in ("stdout", "sink") or (way == "SIGSTOP" and state != "scanning")
        dark_s = 0.0 if expected_to_go_on else max(0.0, dark_s)
        left = _left(seen)
        after = left
        if left:
            subprocess.run(
                [sys.executable, "-m", "picoradar.instrument.cli", "off", "--settings", settings],
                check=False, capture_output=True, timeout=LONGEST_S,
            )  # fmt: skip
            time.sleep(0.2)
            after = _left(_seen(folder))
        said = "laser off verified" in text or "NOT VERIFIED" in text or _recorded(recording)
        said = said or state in ("connected", "warming", "ready", "fault")  # no light yet, or said before
        return Ended(way, state, program.returncode, dark_s, left, after, said, text.strip()[-300:])


def _do(way: str, program: subprocess.Popen[bytes]) -> None:
    if way == "thread" and program.stdin is not None:
        program.stdin.write(b"now\n")
        program.stdin.flush()
    elif way == "stdout" and program.stdout is not None:
        program.stdout.close()
        program.stdout = None
    elif way == "SIGSTOP":
        program.send_signal(signal.SIGSTOP)
        time.sleep(STOPPED_S)
        program.send_signal(signal.SIGCONT)
    elif way.startswith("SIG"):
        program.send_signal(signal.Signals[way.split()[0]])
        if way.endswith("twice"):
            time.sleep(0.15)
            program.send_signal(signal.SIGINT)


def _seen(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "seen.jsonl").read_text().splitlines() if line.endswith("}")]


def _left(seen: list[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(name for name in ("gate", "triggers", "output") if seen[-1][name])


def _recorded(path: Path) -> bool:
    try:
        with Recording.open(path) as recording:
            return recording.laser_off_verified is not None
    except RecordingError:
        return False


def _wait_for(condition: Any, what: str) -> None:
    end = time.monotonic() + LONGEST_S
    while not condition():
        if time.monotonic() > end:
            raise RuntimeError(what)
        time.sleep(0.02)


def main() -> int:
    """Print a table; exit 1 when a promise was not kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ways", nargs="+", default=[*SIGNALS, *DEFECTS])
    parser.add_argument("--states", nargs="+", default=STATES)
    parser.add_argument("--at-once", type=int, default=3, help="programs side by side")
    chosen = parser.parse_args()
    jobs = [(way, state) for way in chosen.ways for state in chosen.states if way not in DEFECTS or state == "scanning"]
    with ThreadPoolExecutor(chosen.at_once) as pool:
        found = list(pool.map(lambda job: one(*job), jobs))
    print("| way | states | dark after, s | exit | left on | after `picoradar off` | said | as promised |")
    print("|---|---|---|---|---|---|---|---|")
    for way in chosen.ways:
        mine = [ended for ended in found if ended.way == way]
        exits = ", ".join(str(status) for status in sorted({e.status for e in mine}))
        left = ", ".join(sorted({name for e in mine for name in e.left})) or "nothing"
        after = ", ".join(sorted({name for e in mine for name in e.after_off})) or "nothing"
        dark = max((e.dark_s for e in mine), default=0.0)
        said, sound = sum(e.said for e in mine), sum(e.sound for e in mine)
        print(f"| {way} | {len(mine)} | {dark:.2f} | {exits} | {left} | {after} | {said} | {sound} of {len(mine)} |")
    for ended in found:
        if not ended.sound:
            print(f"  {ended}")
    return 0 if all(ended.sound for ended in found) else 1


if __name__ == "__main__":
    sys.exit(main())
