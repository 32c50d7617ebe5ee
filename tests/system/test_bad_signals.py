"""Whatever the receiver sees, a scan goes to its end: each place has its flag, and none a range without a warrant."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.line import Flag
from picoradar.instrument.recording import Recording


@pytest.mark.parametrize("mode", ["sweep", "window"])
@pytest.mark.parametrize(
    ("simulation", "flag", "has_range"),
    [
        ({"target_pose": "[500, 0, 900, 0, 0, 0]"}, Flag.NO_ECHO, False),  # the beam misses
        ({"reflectance": 0.002}, Flag.NO_ECHO, False),  # black
        ({"reflectance": 0.08}, Flag.LOW_RESPONSE, True),
        ({"avalanche_gain": 200.0}, Flag.CLIPPED, None),  # bright beyond the A/D
        ({"amplifier_noise_mv": 12.0}, None, None),  # codes at both ends, forms of all kinds
    ],
)
def test_a_scan_survives_its_signal(
    mode: str, simulation: dict[str, Any], flag: Flag | None, has_range: bool | None, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    settings, path = tmp_path / "settings.toml", tmp_path / "scan.db"
    lines = [f"{key} = {value}" for key, value in {"target": '"plate"', **simulation}.items()]
    settings.write_text("\n".join(["[simulation]", *lines]), encoding="utf-8")
    code = run(["scan", "--settings", str(settings), "--grid", "2x6", "--mode", mode, "-o", str(path), "--json"])
    out = capsys.readouterr().out
    assert code in (0, 4), out  # without a reference the controller ends the scan, safely
    assert json.loads(out).get("error", "").count("Traceback") == 0
    with Recording.open(path) as recording:
        cloud = recording.cloud()
        assert recording.laser_off_verified
    if len(cloud):
        refused = ~cloud.has_range
        assert (cloud.flags != 0).all()
        if flag is not None:
            assert ((cloud.flags & np.uint16(flag)) != 0).all()
        assert np.isnan(cloud.range_mm[refused]).all()
        if has_range is not None:
            assert cloud.has_range.all() == has_range
