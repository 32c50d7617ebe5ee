"""Records a scan on a disk that fails at each of its write calls in turn, and prints what became of it as JSON.

Run under LD_PRELOAD of failing_disk.c by test_recording_crash.py: ``python failing_disk.py FOLDER``.
"""

from __future__ import annotations

import ctypes
import errno
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from recording_writer import FORM, make_line

from picoradar.instrument.recording import Recording, RecordingError

LINES, SIZE = 2, (6, 40)
HEADER = {"raster": {"rows": LINES, "columns": SIZE[0]}, "trace": FORM}
DISK = ctypes.CDLL(None)
DISK.failing_disk_calls.restype = ctypes.c_long


@dataclass
class Outcome:
    """What became of all runs with one kind of failure."""

    kind: str
    calls: int = 0
    runs: int = 0
    failed: int = 0
    lost_lines: int = 0
    damaged_lines: int = 0
    unreadable: int = 0
    false_ends: int = 0
    not_resumed: int = 0


def record(path: Path, acknowledged: list[int]) -> None:
    """Record a whole scan."""
    with Recording.create(path, HEADER) as recording:
        for index in range(LINES):
            recording.append(make_line(index, *SIZE))
            acknowledged.append(index)
        recording.event(9.0, "state", state="ready")
        recording.finish("complete", laser_off_verified=True)


def try_all(folder: Path, kind: str, error: int, for_ever: bool) -> Outcome:
    """Let the first, the second ... write call fail, until a run needs fewer."""
    outcome = Outcome(kind)
    while True:
        path = folder / f"{kind}-{outcome.runs}.db"
        acknowledged: list[int] = []
        failed = False
        DISK.failing_disk_arm(ctypes.c_long(outcome.runs), error, int(for_ever))
        try:
            record(path, acknowledged)
        except RecordingError:
            failed = True
        outcome.calls = DISK.failing_disk_calls()
        DISK.failing_disk_arm(ctypes.c_long(-1), 0, 0)
        if outcome.calls <= outcome.runs:
            return outcome
        outcome.runs += 1
        outcome.failed += failed
        judge(path, acknowledged, failed, outcome)


def judge(path: Path, acknowledged: list[int], failed: bool, outcome: Outcome) -> None:
    """Open what is left, on a sound disk again, and go on with it."""
    if not path.exists():
        outcome.lost_lines += len(acknowledged)
        return
    try:
        with Recording.open(path) as recording:
            outcome.lost_lines += len(set(acknowledged) - set(recording.done))
            outcome.damaged_lines += sum(not check.ok for check in recording.check())
            outcome.false_ends += not failed and recording.stop_reason != "complete"
            complete = recording.complete
    except RecordingError as error:
        sys.stderr.write(f"{error}\n")
        outcome.unreadable += 1
        return
    if not complete:
        with Recording.resume(path) as recording:
            for index in recording.missing:
                recording.append(make_line(index, *SIZE))
            recording.finish("complete", laser_off_verified=True)
    with Recording.open(path) as recording:
        outcome.not_resumed += not (recording.complete and all(check.ok for check in recording.check()))


if __name__ == "__main__":
    place = Path(sys.argv[1])
    kinds = (("EIO once", errno.EIO, False), ("EIO from then on", errno.EIO, True), ("disk full", errno.ENOSPC, True))
    sys.stdout.write(json.dumps([asdict(try_all(place, *kind)) for kind in kinds]))
