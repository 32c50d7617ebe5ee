"""The incident log outside of the recordings, and the interlock that is opened by hand."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.events import incidents
from picoradar.sim import SimulatedBench


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PICORADAR_LOG", str(tmp_path / "log"))
    return tmp_path / "log" / "incidents.log"


def test_what_goes_wrong_stands_in_the_log_and_doctor_shows_it(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["scan", "--grid", "2x2", "-o", str(tmp_path / "sound.db")]) == 0
    assert not log.exists()
    faults = tmp_path / "faults.json"
    faults.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": {"pulse": 9000}}]}), encoding="utf-8")
    assert run(["scan", "--grid", "2x2", "-o", str(tmp_path / "scan.db"), "--faults", str(faults)]) == 4
    told = capsys.readouterr().err
    kept = incidents.last_incidents(10)
    assert all({"time", "level", "event"} <= set(incident) for incident in kept)
    assert kept[-1]["event"] == "command ended"
    assert kept[-1]["error"] in told
    assert run(["doctor", "--json"]) == 0
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert result["incidents"] == {"file": str(log), "last": kept[-5:]}
    if os.name != "nt":
        assert log.parent.stat().st_mode & 0o077 == 0


def test_the_log_does_not_grow_without_end(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(incidents, "MAX_BYTES", 2000)
    keep = incidents.IncidentLog(log)
    for number in range(500):
        keep(None, "error", {"event": "noise", "number": number})
        keep(None, "info", {"event": "nothing"})
    files = list(log.parent.iterdir())
    assert len(files) == 1 + incidents.OLDER_FILES
    assert sum(file.stat().st_size for file in files) <= 2000 * len(files)
    assert incidents.last_incidents(1)[0]["number"] == 499


def test_a_log_that_cannot_be_written_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("PICORADAR_LOG", str(tmp_path / "file"))
    incidents.note_incident("something")
    assert incidents.last_incidents(3) == []


def test_a_user_without_a_home_can_switch_off(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As for a system service at boot, or in a container."""

    def nowhere() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("PICORADAR_LOG", "PICORADAR_CACHE", "XDG_STATE_HOME", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", nowhere)
    incidents.note_incident("something")
    assert incidents.last_incidents(3) == []
    assert run(["off", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["laser_off_verified"]
    assert run(["cache", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["models"] == 0


def test_the_interlock_opened_by_hand_must_show_at_bridge_and_supply(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "--interlock", "--json"]) == 0
    devices = json.loads(capsys.readouterr().out)["devices"]
    assert [d["ok"] for d in devices if "interlock" in d["name"]] == [True, True]


@pytest.mark.parametrize("device", ["genesys", "bridge"])
def test_a_device_that_does_not_see_it_is_named_with_the_remedy(
    device: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As with a supply whose switch SW1-9 is down, or a wire that is not connected."""
    begin = SimulatedBench.__init__

    def cut(bench: SimulatedBench, *arguments: Any, **named: Any) -> None:
        begin(bench, *arguments, **named)
        parts = (bench.genesys.supply,) if device == "genesys" else (bench.bridge, bench.bridge.gate)
        for part in parts:
            monkeypatch.setattr(part, _chain_of(part, bench.interlock), type(bench.interlock)())

    monkeypatch.setattr(SimulatedBench, "__init__", cut)
    assert run(["doctor", "--interlock", "--json"]) == 3
    devices = json.loads(capsys.readouterr().out)["devices"]
    problems = {d["name"]: d["problem"] for d in devices if "interlock" in d["name"]}
    wrong = "interlock at the supply" if device == "genesys" else "interlock at the bridge"
    assert "did not see the interlock open" in problems.pop(wrong)
    assert list(problems.values()) == [None]


def _chain_of(owner: object, chain: object) -> str:
    (name,) = [name for name, value in vars(owner).items() if value is chain]
    return name
