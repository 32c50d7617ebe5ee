"""A scan that was broken off, in whatever way, goes on to the same bytes as one that was not."""

from __future__ import annotations

import io
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults import resumes
from picoradar.instrument.cli.main import run
from picoradar.instrument.recording import Recording, RecordingError

SCAN = ("scan", "--grid", "6x5", "--seed", "4", "--json")


def content(path: Path) -> list[bytes]:
    """Everything that a scan is about: raw traces, points, covariance, flags; not when it was taken."""
    with Recording.open(path) as recording:
        lines = list(recording.lines())
        cloud = recording.cloud()
    names = ("points_mm", "covariance_mm2", "range_mm", "range_variance_mm2", "response_mv", "flags", "rows", "columns")
    return [line.sums.tobytes() for line in lines] + [np.ascontiguousarray(getattr(cloud, n)).tobytes() for n in names]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    path = tmp_path_factory.mktemp("whole") / "scan.db"
    assert run([*SCAN, "-o", str(path)]) == 0
    return content(path)


def start(path: Path, lines: int) -> subprocess.Popen[str]:
    """Start a scan in a process of its own, slowly, and wait until some lines are in its recording."""
    process = subprocess.Popen(
        [sys.executable, "-m", "picoradar.instrument.cli", *SCAN, "--speed", "25", "-o", str(path)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    end = time.monotonic() + 40
    while time.monotonic() < end and process.poll() is None:
        try:
            with Recording.open(path) as recording:
                if len(recording.done) >= lines:
                    return process
        except RecordingError:
            pass
        time.sleep(0.02)
    process.kill()
    raise AssertionError(f"no {lines} lines: {process.communicate()}")


def goes_on(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    capsys.readouterr()
    code = run(["resume", str(path), "--json"])
    out = capsys.readouterr()
    assert code == 0, out.err
    result: dict[str, object] = json.loads(out.out)
    assert result["lines"] == 6
    assert result["laser_off_verified"] is True
    return result


@pytest.mark.parametrize("stop_after", [0, 2, 4])
def test_an_aborted_scan_goes_on_to_the_same_bytes(
    stop_after: int, whole: list[bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scan.db"
    fault = tmp_path / "emergency.json"  # the interlock opens in the middle of a line
    at = {"pulse": 1 + (5 * stop_after + 3) * 8 * 1446}
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": at}]}), encoding="utf-8")
    assert run([*SCAN, "-o", str(path), "--faults", str(fault)]) == 4
    with Recording.open(path) as broken_off:
        assert broken_off.done == list(range(stop_after))
        assert broken_off.laser_off_verified
        assert broken_off.header["faults"][0]["kind"] == "interlock_opened"
    assert goes_on(path, capsys)["lines_taken"] == 6 - stop_after
    assert content(path) == whole


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGKILL])
def test_a_killed_scan_goes_on_to_the_same_bytes(
    number: signal.Signals, whole: list[bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scan.db"
    process = start(path, lines=2)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    if number is signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 130, err
        assert json.loads(out)["exit_status"] == 130
        assert "laser off verified" in err
    with Recording.open(path) as broken_off:
        kept = broken_off.done
        assert len(kept) >= 2
        assert all(line.ok for line in broken_off.check())
        assert broken_off.laser_off_verified is (None if number is signal.SIGKILL else True)
    assert goes_on(path, capsys)["lines_taken"] == 6 - len(kept)
    assert content(path) == whole


def test_a_whole_scan_is_not_gone_on_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scan.db"
    assert run(["scan", "--grid", "2x2", "-o", str(path), "--json"]) == 0
    assert run(["resume", str(path)]) == 2
    assert "holds all its lines" in capsys.readouterr().err
    assert run(["resume", str(tmp_path / "nothing.db")]) == 2


@pytest.mark.parametrize("world", ["dissertation", "clinic"])
def test_a_scan_in_windows_goes_on_to_the_same_bytes(
    world: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each line is planned from those before: what was known of them is in the recording."""
    scan = ("scan", "--world", world, "--grid", "8x6", "--mode", "window", "--seed", "4", "--json")
    fault = tmp_path / "lid.json"
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": {"pulse": 6000}}]}), encoding="utf-8")
    paths = tmp_path / "whole.db", tmp_path / "broken.db"
    assert run([*scan, "-o", str(paths[0])]) == 0
    assert run([*scan, "-o", str(paths[1]), "--faults", str(fault)]) in (3, 4)
    with Recording.open(paths[1]) as broken_off:
        assert 0 < len(broken_off.done) < 8
    assert run(["resume", str(paths[1]), "--json"]) == 0, capsys.readouterr().err
    clouds = []
    for path in paths:
        with Recording.open(path) as recording:
            clouds.append(recording.cloud())
    for name in ("points_mm", "covariance_mm2", "range_mm", "response_mv", "flags"):
        assert np.array_equal(getattr(clouds[0], name), getattr(clouds[1], name), equal_nan=True), name


@pytest.mark.parametrize("lines", [1, 2])
def test_a_scan_in_windows_killed_after_a_line_goes_on_to_the_same_bytes(lines: int, tmp_path: Path) -> None:
    """The mirrors still creep from the line before, and polls fall due by time: both must come out as without it."""
    scan = ["scan", "--grid", "8x12", "--mode", "window", "--seed", "77", "-o"]
    uninterrupted, killed = tmp_path / "whole.db", tmp_path / "killed.db"
    assert resumes.in_a_process(lambda: resumes.quiet([*scan, str(uninterrupted)])) == 0
    assert resumes.in_a_process(lambda: resumes.scan_until(lines, [*scan, str(killed)])) == -signal.SIGKILL
    assert resumes.in_a_process(lambda: resumes.quiet(["resume", str(killed)])) == 0
    assert resumes.content(killed) == resumes.content(uninterrupted)


@pytest.mark.slow
@pytest.mark.parametrize(("grid", "mode", "seed"), [("20x20", "window", 5), ("6x40", "sweep", 8)])
def test_killed_after_every_line_a_scan_goes_on_to_the_same_bytes(grid: str, mode: str, seed: int) -> None:
    assert all(resumes.campaign(grid, mode, seed))


@pytest.fixture
def of_devices(tmp_path: Path) -> Path:
    """A recording whose header names real devices that are not there."""
    path = tmp_path / "devices.db"
    fault = tmp_path / "emergency.json"
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": {"pulse": 50_000}}]}), encoding="utf-8")
    assert run([*SCAN, "-o", str(path), "--faults", str(fault)]) == 4
    with sqlite3.connect(path) as database:
        (text,) = database.execute("SELECT header FROM scan").fetchone()
        header = json.loads(text)
        header["settings"]["bench"] = "devices"
        header["settings"]["links"] |= {"dg645": "/dev/tty-a", "genesys": "/dev/tty-b", "tec": "/dev/tty-c"}
        text = json.dumps(header)
        database.execute("UPDATE scan SET header=?, header_crc32=?", (text, zlib.crc32(text.encode())))
    database.close()
    return path


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(err: str) -> list[str]:
    return [word for word in ("/dev/tty-a", "/dev/tty-b", "/dev/tty-c", "290 V at 80000 Hz", "0.3 mW") if word in err]


def test_real_devices_are_shown_and_asked_for(
    of_devices: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = of_devices.read_bytes()
    for answer, code in (("n\n", 130), ("\n", 130), ("", 130), ("yes\n", 3)):  # 3: agreed, and the port is not there
        monkeypatch.setattr(sys, "stdin", Terminal(answer))
        capsys.readouterr()
        assert run(["resume", str(of_devices), "--json"]) == code, answer
        told = capsys.readouterr()
        assert len(shown(told.err)) == 5
        assert json.loads(told.out)["exit_status"] == code
    assert of_devices.read_bytes() == before


def test_without_a_terminal_the_answer_must_be_on_the_command_line(
    of_devices: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for closed in (io.StringIO("yes\n"), None):  # None: it was closed before the program began
        monkeypatch.setattr(sys, "stdin", closed)
        assert run(["resume", str(of_devices)]) == 2
        told = capsys.readouterr().err
        assert len(shown(told)) == 5
        assert "--yes" in told
    assert run(["resume", str(of_devices), "--yes"]) == 3
    told = capsys.readouterr().err
    assert len(shown(told)) == 5
    assert "--yes" not in told
