"""Every way out of a scan ends in the dark: by the word of the devices, and by the bench itself."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import DeviceError
from picoradar.instrument.bench import make_bench
from picoradar.instrument.cli.main import run
from picoradar.instrument.controller import Controller, make_safe
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording, RecordingError
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import Fault, arm


class Broken(Exception):
    """A defect of the program."""


def at_line(radar: Any, index: int, act: Callable[[], None]) -> Callable[[ScanLine], None]:
    return lambda line: act() if line.index == index else None


def assert_dark(radar: Any, reason: str, lines: int | None = None) -> None:
    assert not radar.lit
    assert radar.controller.safe.laser_off_verified
    assert radar.bench.sampler.status().gate != "on"
    with radar.last_recording() as recording:
        assert recording.laser_off_verified is True
        assert reason in (recording.stop_reason or "")
        steps = [event for event in recording.events() if event.kind == "safe state"]
        assert steps
        assert steps[-1].fields["gate"] == "verified"
        assert lines is None or recording.done == list(range(lines))


@pytest.mark.parametrize(
    ("way", "reason", "lines"),
    [("finish", "finished early", 3), ("abort", "aborted", 2), ("interrupt", "interrupted", 2)],
)
def test_ways_to_stop_leave_the_radar_ready(radar: Any, way: str, reason: str, lines: int) -> None:
    after_line_1 = at_line(radar, 1, lambda: radar.clock.call_at(radar.clock.now() + 0.2, lambda: ask(radar, way)))
    outcome = radar.scan(after_line_1)
    assert outcome.stop_reason == reason
    assert radar.controller.state == "ready"
    assert_dark(radar, reason, lines)


def ask(radar: Any, what: str) -> None:
    radar.controller.request(what)


def test_emergency_off_latches_a_fault_and_stops_the_diode_too(radar: Any) -> None:
    with pytest.raises(InterlockTripped, match="emergency off"):
        radar.scan(at_line(radar, 1, lambda: ask(radar, "emergency off")))
    assert radar.controller.state == "fault"
    assert "emergency off" in radar.controller.why()[0]
    assert not radar.bench.diode.status().regulating
    assert_dark(radar, "emergency off", 2)
    assert "emergency off" in radar.controller.acknowledge()
    assert radar.controller.state == "off"
    assert radar.controller.why() == []
    radar.get_ready()  # and everything can be done again
    assert radar.scan().stop_reason == "complete"


@pytest.mark.parametrize("error", [Broken("a defect"), KeyboardInterrupt(), SystemExit(1), MemoryError()], ids=repr)
def test_any_exception_on_the_way_ends_in_the_dark(radar: Any, error: BaseException) -> None:
    def fail() -> None:
        raise error

    job = radar.job()
    take = job.take_line
    job.take_line = lambda row, *rest: fail() if row == 2 else take(row, *rest)
    with radar.recording() as recording, pytest.raises(type(error)):
        radar.controller.scan(job, recording)
    assert radar.controller.state == "fault"
    assert radar.controller.cause
    assert_dark(radar, type(error).__name__, 2)


def test_a_viewer_that_fails_is_left_out_and_the_scan_goes_on(radar: Any) -> None:
    seen: list[int] = []

    def viewer(line: ScanLine) -> None:
        seen.append(line.index)
        raise Broken("no display")

    assert radar.scan(viewer).lines == 4
    assert seen == [0]


@pytest.mark.parametrize("when", ["append", "event", "finish"])
def test_a_failed_disk_ends_in_the_dark_with_the_lines_so_far(radar: Any, when: str) -> None:
    with radar.recording() as recording:

        class Disk:
            path = recording.path
            append, event, finish = recording.append, recording.event, recording.finish

        def fail(*_: Any, **__: Any) -> None:
            if recording.done == [0, 1] or when == "finish":
                raise RecordingError(recording.path, "the disk is full")
            getattr(recording, when)(*_, **__)

        setattr(Disk, when, staticmethod(fail))
        store = Disk()
        if when == "event":  # an event in mid-scan: a pause
            sink = at_line(radar, 1, lambda: ask(radar, "pause"))
        else:
            sink = at_line(radar, 9, lambda: None)
        with pytest.raises(RecordingError, match="disk is full"):
            radar.scan(sink, store=store)
    assert not radar.lit
    assert radar.controller.safe.laser_off_verified
    with radar.last_recording() as kept:
        assert kept.done == ([0, 1, 2, 3] if when == "finish" else [0, 1])
        assert all(line.ok for line in kept.check())


def test_a_pause_is_dark_and_goes_on(radar: Any) -> None:
    dark: list[bool] = []

    def later() -> None:
        dark.append(not radar.lit and radar.controller.state == "paused")
        ask(radar, "resume")

    def pause() -> None:
        ask(radar, "pause")
        radar.clock.call_at(radar.clock.now() + 5.0, later)

    outcome = radar.scan(at_line(radar, 1, pause))
    assert dark == [True]
    assert (outcome.stop_reason, outcome.lines) == ("complete", 4)


def test_the_scan_waits_for_a_warm_diode_and_says_why(make_radar: Callable[..., Any]) -> None:
    radar = make_radar({"scan": {"rows": 10}})
    radar.get_ready()
    why: list[list[str]] = []

    def warm() -> None:
        now = radar.clock.now()
        heat = {"kind": "diode_disturbed", "lasts_s": 1.2, "parameters": {"current_a": 4.0}}
        arm(radar.sim, [Fault.model_validate({**heat, "at": {"time_s": now}})])
        radar.clock.call_at(now + 4.5, lambda: why.append([radar.controller.state, *radar.controller.why()]))

    outcome = radar.scan(at_line(radar, 0, warm))
    assert why[0][0] == "suspended"
    assert "diode temperature" in why[0][1]
    assert (outcome.stop_reason, outcome.lines, len(outcome.suspended)) == ("complete", 10, 1)


def test_the_gate_closes_by_itself_when_the_host_dies(radar: Any) -> None:
    """The host's thread does nothing any more in the middle of a record: not even its timers run."""
    closed: list[float] = []

    class Dead(BaseException):
        pass

    def die() -> None:
        radar.controller._supervisor._timer.cancel()
        died_s = radar.clock.now()
        while radar.lit and radar.clock.now() < died_s + 3.0:
            radar.clock.sleep(0.001)
        closed.append(radar.clock.now() - died_s)
        raise Dead

    with pytest.raises(Dead):
        radar.scan(at_line(radar, 1, lambda: radar.clock.call_at(radar.clock.now() + 0.1, die)))
    assert 0.0 < closed[0] <= 1.1
    assert radar.sim.bridge.gate.watchdog_tripped
    radar.controller.acknowledge()
    radar.get_ready()  # the lock-out is cleared on purpose, once a person asks for light again
    assert radar.scan().stop_reason == "complete"


def test_a_setting_above_class_1_is_refused_before_anything_is_opened() -> None:
    settings = override(Settings(), {"pulser": {"measured_output": ((290.0, 80_000.0, 0.9),)}})
    with SimulatedBench({"target": "plate"}, clock=VirtualClock()) as sim:
        said: list[bytes] = []
        for tap in sim.serial_taps.values():
            tap.to_device.append(lambda data: said.append(data) or data)
        for usb in sim.usb_taps.values():
            usb.before.append(lambda setup: said.append(bytes([setup.request])))
        with pytest.raises(InterlockTripped, match="laser class"):
            Controller(make_bench(Links(**sim.urls), sim.clock, sim.usb_backend), settings)
        assert said == []


def test_an_open_lid_refuses_the_scan_before_light_and_names_itself(radar: Any) -> None:
    radar.sim.interlock.closed = False
    with pytest.raises(InterlockTripped, match="interlock line"):
        radar.scan()
    assert radar.controller.state == "ready"
    assert any("interlock line" in line for line in radar.controller.why())
    assert_dark(radar, "interlock line", 0)
    radar.sim.interlock.closed = True
    assert radar.scan().stop_reason == "complete"


def test_a_connect_that_fails_switches_off_what_it_can_reach(make_radar: Callable[..., Any]) -> None:
    radar = make_radar()
    radar.sim.usb_backend.unplug(radar.sim.usb_taps["bridge"])
    with pytest.raises(DeviceError, match="sampling bridge"):
        radar.controller.connect()
    assert radar.controller.state == "fault"
    assert radar.controller.safe.steps["pulser"] == "verified"
    assert radar.controller.safe.laser_off_verified


def test_a_gate_that_does_not_close_is_told_and_the_pulser_proves_the_dark(radar: Any) -> None:
    arm(radar.sim, [Fault(kind="gate_off_ignored", link="bridge", at={"time_s": 0.0}, lasts_s=1e6)])
    outcome = radar.scan()
    assert not radar.lit
    assert "still on" in outcome.safe.steps["gate"]
    assert outcome.safe.laser_off_verified


# Settings and files that are not what they should be


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[scan]\nrows = 5000", "rows"),
        ("[scan]\nrows = 40\nwarp = 9", "unknown key"),
        ("[scan]\nrows = '40'\ncolumns = true", "scan"),
        ("[pulser]\ndrive_v = nan", "drive_v"),
        ("[pulser]\nmeasured_output = [[290.0, 80000.0, -1.0]]", "above 0"),
        ("[pulser]\nmeasured_output = []", "measured_output"),
        ("[scan]\ncolumns = 1000\n[sampler]\nsamples = 16384", "1.0 GB of memory"),
        ("[sampler]\nstep_ps = 0", "step_ps"),
        ("seed = -1", "seed"),
        ("not toml at all", "TOML"),
    ],
)
def test_settings_that_attack_are_refused_with_the_number(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bench.toml"
    file.write_text(text, encoding="utf-8")
    assert run(["scan", "--settings", str(file), "-o", str(tmp_path / "scan.db"), "--json"]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "scan.db").exists()


def test_a_name_that_leads_out_of_its_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["scan", "--out", str(tmp_path / "here"), "-o", "../there.db"]) == 2
    assert "leads out of the folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_disk_without_room_is_refused_with_the_numbers(radar: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = type("Usage", (), {"free": 20_000})
    monkeypatch.setattr("picoradar.instrument.controller.disk.shutil.disk_usage", lambda _path: usage)
    with pytest.raises(InterlockTripped, match=r"disk space.*4 lines take up to .* GB, 2e-05 GB are free"):
        radar.scan()
    assert radar.controller.state == "ready"
    assert not radar.lit


def test_the_way_out_works_on_a_bench_that_was_never_opened() -> None:
    with SimulatedBench({"target": "plate"}, clock=VirtualClock()) as sim:
        safe = make_safe(make_bench(Links(**sim.urls), sim.clock, sim.usb_backend))
    assert not safe.laser_off_verified
    assert set(safe.steps) == {"gate", "pulser", "run", "mirrors"}


def test_a_scan_that_was_refused_leaves_a_recording_that_says_so(tmp_path: Path) -> None:
    path = tmp_path / "scan.db"
    fault = tmp_path / "lid.json"
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": {"time_s": 20.0}}]}), encoding="utf-8")
    assert run(["scan", "--grid", "2x2", "--faults", str(fault), "-o", str(path), "--json"]) == 4
    with Recording.open(path) as recording:
        assert recording.done == []
        assert "interlock line" in (recording.stop_reason or "")
        assert recording.laser_off_verified is True
