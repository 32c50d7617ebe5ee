"""A command that ends before its work is done says what is kept, where, and which command goes on."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.recording import Recording


@pytest.mark.parametrize(
    ("fault", "status"),
    [
        ([{"kind": "usb_unplugged", "link": "bridge", "at": {"pulse": 60_000}}], 3),
        ([{"kind": "unplugged", "link": "dg645", "at": {"pulse": 60_000}}], 3),
        ([{"kind": "interlock_opened", "at": {"pulse": 60_000}}], 4),
    ],
    ids=["bridge", "generator", "lid"],
)
def test_a_scan_that_loses_its_devices_names_the_command_that_goes_on(
    fault: list[dict[str, Any]], status: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, faults = tmp_path / "scan.db", tmp_path / "faults.json"
    faults.write_text(json.dumps({"fault": fault}), encoding="utf-8")
    assert run(["scan", "--grid", "6x3", "--seed", "4", "-o", str(path), "--faults", str(faults)]) == status
    said = capsys.readouterr().err
    with Recording.open(path) as recording:
        lines = len(recording.done)
    assert 0 < lines < 6
    assert f"{lines} lines kept in {path}" in said
    (command,) = re.findall(r"go on with: picoradar (.*)", said)
    assert run(command.split()) == 0
    with Recording.open(path) as recording:
        assert recording.complete


@pytest.mark.parametrize("command", ["scan -o", "demo --out", "info", "info --salvage", "resume"])
def test_a_name_that_the_system_does_not_take_is_refused_in_words(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command.split(), "a" * 300]) == 2
    assert "too long" in capsys.readouterr().err


def test_an_interruption_after_the_light_does_not_deny_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is found is shown when the scan is over and the bench is closed."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("picoradar.instrument.cli.output.print_table", interrupted)
    assert run(["scan", "--grid", "2x2", "-o", str(tmp_path / "scan.db")]) == 130
    assert "interrupted while no device was open and the laser off" in capsys.readouterr().err
