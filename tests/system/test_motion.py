"""A target that moves during a scan is flagged, one at rest is not; through drivers and firmware."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.line import Flag
from picoradar.instrument.recording import Recording


@pytest.fixture
def scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    def _scan(motion_mm: float, *arguments: str) -> tuple[dict[str, Any], np.ndarray]:
        settings, path = tmp_path / f"{motion_mm}.toml", tmp_path / f"{motion_mm}.db"
        settings.write_text(f"[simulation]\nmotion_mm = {motion_mm}\nmotion_period_s = 4.0\n", encoding="utf-8")
        assert run(["scan", "--settings", str(settings), *arguments, "-o", str(path), "--json"]) == 0
        with Recording.open(path) as recording:
            moved = [bool((line.flags & np.uint16(Flag.MOTION)).all()) for line in recording.lines()]
            partly = [bool((line.flags & np.uint16(Flag.MOTION)).any()) for line in recording.lines()]
        assert moved == partly  # a line as a whole
        return json.loads(capsys.readouterr().out), np.array(moved)

    return _scan


@pytest.mark.parametrize("mode", [("window", "13x40"), ("sweep", "6x40")])
def test_breathing_is_flagged_and_rest_is_not(scan: Any, mode: tuple[str, str]) -> None:
    arguments = ("--mode", mode[0], "--grid", mode[1], "--seed", "6", "--target", "plate")
    still, no_line = scan(0.0, *arguments)
    breathing, lines = scan(4.0, *arguments)
    assert not no_line.any()
    assert "motion" not in still["flags"]
    assert lines[3:].any()
    assert breathing["flags"]["motion"] == 40 * lines.sum()
    assert breathing["points"] == still["points"]
