"""Scans that are registered while they are made: when they end, what is left of it, and that it harms none."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.instrument.cli import following, scanning, session
from picoradar.instrument.cli.main import run
from picoradar.instrument.controller.safety import SafeShutdown
from picoradar.instrument.recording import Recording, RecordingError, salvage
from picoradar.instrument.settings import Settings, override
from picoradar.registration.live import LiveRegistration
from picoradar.sim.physics import SOCKET_CENTRE_MM
from picoradar.sim.physics.targets import HIP_FILE

RASTER = ("--grid", "26x26", "--step-mm", "1.5", "--order", "interlaced")
SCAN = ("scan", *RASTER, "--mode", "window", "--material", "bone")
TIMES = ("wall_s", "recording")
CLOCKED = ("prepare_ms", "register_ms")

SLOW_S = 0.3  # of wall time in a line, many times what the simulated bench needs for one

Scan = Callable[..., tuple[int, dict[str, Any]]]


@pytest.fixture
def targets(tmp_path: Path) -> Path:
    path = tmp_path / "targets.json"
    path.write_text(json.dumps([{"name": "socket centre", "position": list(SOCKET_CENTRE_MM)}]), encoding="utf-8")
    return path


@pytest.fixture
def scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Scan:
    def _scan(name: str, *more: str) -> tuple[int, dict[str, Any]]:
        code = run([*SCAN, *more, "-o", str(tmp_path / name), "--json"])
        out = capsys.readouterr()
        return code, json.loads(out.out)

    return _scan


def test_a_scan_ends_safely_as_soon_as_its_pose_is_good_enough(
    scan: Scan, targets: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, found = scan("a.db", "--register", str(HIP_FILE), "--targets", str(targets), "--until-tre", "0.3")
    assert code == 0
    assert found["stop_reason"] == "registered"
    assert found["laser_off_verified"]
    assert found["zero_check"]["outcome"] == "passed"  # also measured after the last line
    assert found["lines"] < 20
    registration = found["registration"]
    assert registration["verdict"] == "pass"
    assert len(registration["lines_used"]) == found["lines"]
    (target,) = registration["targets"]
    assert target["tre_mm"] <= 0.3
    assert registration["live"]["pose_after_s"] < registration["live"]["reached_after_s"] < 8.0
    at = np.array([*target["position"], 1.0])
    wrong = np.array(registration["model_from_scanner"]) @ np.linalg.inv(found["truth"]["model_from_scanner"]) @ at - at
    assert np.linalg.norm(wrong) < 3 * target["tre_mm"]
    assert run(["register", str(tmp_path / "a.db"), str(HIP_FILE), "--targets", str(targets), "--json"]) == 0
    alone = json.loads(capsys.readouterr().out)
    for key in ("model_from_scanner", "verdict", "reasons", "inliers", "points", "rivals", "predicted_rotation_deg"):
        assert registration[key] == alone[key], key


def test_the_result_stands_in_the_recording_with_its_digests(
    scan: Scan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, found = scan("a.db", "--register", str(HIP_FILE))
    path = tmp_path / "a.db"
    with Recording.open(path) as recording:
        (kept,) = recording.registrations()
        assert kept["lines_recorded"] == len(recording.done)
        assert kept["calibration_digest"] == recording.header["calibration_digest"]
    for key in ("model_from_scanner", "covariance", "verdict", "targets", "lines_used", "live"):
        assert kept[key] == found["registration"][key], key
    assert np.array(kept["covariance"]).shape == (6, 6)
    assert kept["model"] == "hip_right.stl"
    assert len(kept["model_digest"]) == len(kept["settings_digest"]) == len(kept["sha256"]) == 64
    assert run(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["registration"] == kept
    assert run(["info", str(path)]) == 0
    assert "pass, of" in capsys.readouterr().out
    salvaged, _, _ = salvage(path)
    with Recording.open(salvaged) as recording:
        assert recording.registrations() == [kept]


def test_a_registration_that_was_changed_is_refused(scan: Scan, tmp_path: Path) -> None:
    scan("a.db", "--register", str(HIP_FILE))
    import sqlite3

    with sqlite3.connect(tmp_path / "a.db") as database:
        database.execute("UPDATE registration SET content = replace(content, '\"pass\"', '\"fail\"')")
    with Recording.open(tmp_path / "a.db") as recording, pytest.raises(RecordingError, match="digest"):
        recording.registrations()


def test_a_seed_repeats_to_the_last_bit_and_the_rest_of_the_raster_can_be_taken(
    scan: Scan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, whole = scan("whole.db", "--seed", "7")
    (_, one), (_, two) = (scan(name, "--seed", "7", "--register", str(HIP_FILE)) for name in ("a.db", "b.db"))
    for found in (one, two):
        for key in TIMES:
            del found[key]
        for key in CLOCKED:
            del found["registration"][key]
    assert one == two
    assert whole["lines"] == 26
    assert "registration" not in whole
    assert run(["resume", str(tmp_path / "a.db"), "--json"]) == 0
    resumed = json.loads(capsys.readouterr().out)
    assert (resumed["lines"], resumed["stop_reason"]) == (26, "complete")
    clouds = []
    for name in ("whole.db", "a.db"):
        with Recording.open(tmp_path / name) as recording:
            clouds.append(recording.cloud())
    for name in ("points_mm", "covariance_mm2", "response_mv", "flags"):
        assert np.array_equal(getattr(clouds[0], name), getattr(clouds[1], name), equal_nan=True), name


def test_what_no_line_can_bring_does_not_end_the_scan(scan: Scan, targets: Path) -> None:
    code, found = scan("a.db", "--register", str(HIP_FILE), "--targets", str(targets), "--until-tre", "0.01")
    assert code == 0
    assert (found["stop_reason"], found["lines"]) == ("complete", 26)
    assert found["registration"]["verdict"] == "pass"
    assert found["registration"]["live"]["reached_after_s"] is None


@pytest.mark.slow
def test_another_body_fails_and_says_so(scan: Scan) -> None:
    code, found = scan("a.db", "--register", str(HIP_FILE), "--target", "prism")
    assert code == 1
    assert found["stop_reason"] == "complete"
    assert found["laser_off_verified"]
    assert found["registration"]["verdict"] == "fail"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--until-tre", "0.3"), "--until-tre: of a registration; name the model with --register MODEL"),
        (("--register", "nothing.stl"), "nothing.stl"),
        (("--register", str(HIP_FILE), "--until-tre", "-1"), "give an error in mm above 0"),
        (("--register", str(HIP_FILE), "--tolerance", "1"), "--tolerance"),
        (("--order", "serpentine"), "order"),
    ],
)
def test_what_cannot_be_done_is_refused_before_there_is_light(
    options: tuple[str, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*SCAN, *options, "-o", str(tmp_path / "a.db")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "a.db").exists()


def recorded(path: Path) -> scanning.RecordedScan:
    table = {"rows": 26, "columns": 26, "step_mm": 1.5, "mode": "window", "material": "bone", "order": "interlaced"}
    with session.session(override(Settings(), {"scan": table}), None) as one:
        session.warm_up(one)
        return scanning.record_scan(one, path, following.asked(HIP_FILE, {}, None))


@pytest.mark.slow
def test_on_a_real_clock_a_slow_registration_takes_its_time_off_the_beams_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The virtual clock says here that it is a real one: lines then go through queues, as fast as they are taken."""
    add, threads, dark = LiveRegistration.add, set[str](), list[bool]()

    def slow(self: LiveRegistration, line: Any) -> Any:
        threads.add(threading.current_thread().name)
        time.sleep(SLOW_S)
        dark.append(over.is_set())
        return add(self, line)

    over = threading.Event()
    alone = recorded(tmp_path / "alone.db").outcome  # in line
    monkeypatch.setattr(LiveRegistration, "add", slow)
    monkeypatch.setattr(VirtualClock, "real_time", True)
    shut_down = SafeShutdown.__call__

    def noted(self: SafeShutdown, **how: Any) -> Any:
        found = shut_down(self, **how)
        over.set()
        return found

    monkeypatch.setattr(SafeShutdown, "__call__", noted)
    scanned = recorded(tmp_path / "slow.db")
    outcome = scanned.outcome
    assert alone.stop_reason == "registered"
    assert outcome.safe.laser_off_verified
    assert (outcome.stop_reason, outcome.lines) == ("complete", 26)  # it was not there in time to end the scan
    assert outcome.sinks["registration"] == "complete"
    assert threads == {"sink registration"}
    assert any(dark)  # the laser was off before it had seen the last lines
    assert outcome.device_time_s / outcome.lines == pytest.approx(alone.device_time_s / alone.lines, rel=0.5)
    assert scanned.described["registration"]["verdict"] == "pass"
    assert scanned.described["registration"]["live"]["lines"] == 26


def test_a_registration_that_raises_harms_neither_scan_nor_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_self: LiveRegistration, _line: object) -> None:
        raise RuntimeError("out of memory")

    monkeypatch.setattr(LiveRegistration, "add", broken)
    scanned = recorded(tmp_path / "a.db")
    assert scanned.outcome.stop_reason == "complete"
    assert scanned.outcome.safe.laser_off_verified
    assert scanned.outcome.sinks["registration"].startswith("failed after 0 of 26 lines: RuntimeError")
    assert scanned.outcome.sinks["result"] == "complete"
    assert scanned.described["registration"]["verdict"] == "pass"
    assert scanned.described["registration"]["live"]["lines"] == 0
