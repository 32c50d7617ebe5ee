"""Another maker's sampler is one line in the settings: the oscilloscope takes the traces, the bridge keeps the gate."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.recording import Recording

SETTINGS = """
[links]
sampler = "oscilloscope"
[pulser]
prf_hz = 20000
[sampler]
settle_shots = 0
[scan]
averages = 16
rows = 1
columns = 4
"""


def test_a_scan_through_the_oscilloscope(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scope.toml").write_text(SETTINGS)
    ranges = {}
    for name, extra in (("scope", ["--settings", str(tmp_path / "scope.toml")]), ("bridge", ["--grid", "1x4"])):
        path = tmp_path / f"{name}.db"
        assert run(["scan", *extra, "--target", "plate", "-o", str(path), "--json"]) == 0, capsys.readouterr().err
        result = json.loads(capsys.readouterr().out)
        assert result["laser_off_verified"]
        with Recording.open(path) as recording:
            ranges[name] = recording.cloud().range_mm
            assert np.abs(recording.traces_mv(recording.line(0))).max() > 30
    assert result["points"] == 4
    # Different noise and rate, the same plate: the two agree to what the noise of four readings allows.
    assert abs(np.mean(ranges["scope"]) - np.mean(ranges["bridge"])) < 1.0


def test_the_doctor_examines_it_and_says_what_it_cannot_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scope.toml").write_text(SETTINGS)
    assert run(["doctor", "--settings", str(tmp_path / "scope.toml"), "--json"]) == 0
    found = {device["name"]: device for device in json.loads(capsys.readouterr().out)["devices"]}
    assert found["oscilloscope"]["ok"]
    (tmp_path / "fast.toml").write_text(SETTINGS.replace("settle_shots = 0", "settle_shots = 16"))
    assert run(["doctor", "--settings", str(tmp_path / "fast.toml"), "--json"]) == 3
    found = {device["name"]: device for device in json.loads(capsys.readouterr().out)["devices"]}
    assert "cannot sample as the settings ask" in found["oscilloscope"]["problem"]
