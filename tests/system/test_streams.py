"""A terminal that goes away, a closed stdout, a full disk behind stderr: the scan is the same, and its exit status."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from picoradar.drivers.links import Transcript
from picoradar.instrument.bench import make_bench
from picoradar.instrument.controller import Controller
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Links
from tests.system.conftest import Radar

COMMAND = (sys.executable, "-m", "picoradar.instrument.cli")
SCAN = ("scan", "--grid", "4x3", "--seed", "4", "-o")
LONG_SCAN = ("scan", "--grid", "20x10", "--seed", "4", "--speed", "10", "-o")  # 0.15 s a line: time to be interrupted
needs_posix = pytest.mark.skipif(os.name == "nt", reason="terminals and /dev/full of POSIX")


def whole(path: Path) -> bool:
    with Recording.open(path) as recording:
        return recording.complete and recording.stop_reason == "complete" and bool(recording.laser_off_verified)


@needs_posix
@pytest.mark.parametrize(
    ("redirected", "told"),
    [
        (">&-", True),
        ("2>/dev/full", False),
        pytest.param(">/dev/full", True, marks=pytest.mark.slow),
        pytest.param("| true", False, marks=pytest.mark.slow),
        pytest.param("2>&-", False, marks=pytest.mark.slow),
    ],
)
def test_a_stream_that_cannot_be_written_changes_nothing(redirected: str, told: bool, tmp_path: Path) -> None:
    path = tmp_path / "scan.db"
    command = f"set -o pipefail; {' '.join((*COMMAND, '--verbose', *SCAN))} {path} {redirected}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert ("stdout could not be written" in done.stderr) is told
    assert "Traceback" not in done.stderr
    assert whole(path)


class Kept(type(Path())):  # type: ignore[misc]
    """A path that keeps the file that was opened, to let its disk fill up."""

    def open(self, *given: Any, **more: Any) -> Any:
        self.file = super().open(*given, **more)
        return self.file


@needs_posix
def test_a_transcript_whose_disk_fills_up_changes_nothing(make_radar: Callable[[], Radar], tmp_path: Path) -> None:
    radar, path = make_radar(), Kept(tmp_path / "transcript.jsonl")
    with Transcript(path) as transcript:
        radar.bench = make_bench(Links(**radar.sim.urls), radar.clock, radar.sim.usb_backend, transcript)
        radar.controller = Controller(radar.bench, radar.settings)
        radar.get_ready()

        def fill(line: ScanLine) -> None:
            if line.index == 1:
                full = os.open("/dev/full", os.O_WRONLY)
                os.dup2(full, path.file.fileno())
                os.close(full)

        outcome = radar.scan(fill)
        assert (outcome.stop_reason, outcome.lines) == ("complete", 4)
        assert outcome.safe.complete
        radar.controller.shut_down()
    assert "No space left" in transcript.failure


@needs_posix
def test_a_terminal_that_is_closed_ends_the_scan_safely(tmp_path: Path) -> None:
    import pty

    path = tmp_path / "scan.db"
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [*COMMAND, *LONG_SCAN, str(path)])
    end = time.monotonic() + 60
    while time.monotonic() < end and not lines_in(path):
        time.sleep(0.05)
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 130
    with Recording.open(path) as recording:
        assert recording.stop_reason == "interrupted"
        assert recording.laser_off_verified
        assert 1 <= len(recording.done) < 20


def lines_in(path: Path) -> int:
    if not path.exists():
        return 0
    try:
        with Recording.open(path) as recording:
            return len(recording.done)
    except Exception:  # noqa: BLE001 - it is just being created
        return 0


@pytest.mark.slow
def test_the_json_of_an_interrupted_scan_is_still_one_object(tmp_path: Path) -> None:
    path = tmp_path / "scan.db"
    process = subprocess.Popen(
        [*COMMAND, *LONG_SCAN, str(path), "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    end = time.monotonic() + 60
    while time.monotonic() < end and not lines_in(path):
        time.sleep(0.05)
    process.terminate()
    process.terminate()  # the second is an emergency off; the status stays that of an interruption
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert json.loads(out)["exit_status"] == 130
    assert "laser off verified" in err
