"""Options that several subcommands share: the simulated world, and what the help of `--target` names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.cli.options import scan_settings
from picoradar.instrument.cli.simulated import checked_simulation
from picoradar.instrument.errors import BadInput
from picoradar.sim.settings import TARGETS


def test_the_option_chooses_the_world_and_written_keys_stay(tmp_path: Path) -> None:
    written = tmp_path / "bench.toml"
    written.write_text('[simulation]\nworld = "dissertation"\nhum_mv = 0.3\n', encoding="utf-8")
    simulation = json.loads(checked_simulation(scan_settings(written, world="clinic")).model_dump_json())
    assert simulation["world"] == "clinic"
    assert simulation["hum_mv"] == 0.3
    assert simulation["flicker_mv"] > 0
    assert json.loads(checked_simulation(scan_settings(written)).model_dump_json())["flicker_mv"] == 0


def test_a_world_is_refused_that_there_is_not_and_on_real_devices(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["scan", "--world", "moon", "-o", str(tmp_path / "a.db")]) == 2
    assert "'dissertation' or 'clinic'" in capsys.readouterr().err
    written = tmp_path / "real.toml"
    written.write_text('bench = "devices"\n', encoding="utf-8")
    with pytest.raises(BadInput, match="--world are of the simulated bench"):
        scan_settings(written, world="clinic")


@pytest.mark.parametrize("command", ["scan", "sim", "demo"])
def test_help_names_every_target_and_world(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    run([command, "--help"])
    shown = capsys.readouterr().out
    for name in ("coated", "sphere", "--world", "clinic"):
        assert name in shown
    assert all(name in TARGETS for name in ("coated", "sphere"))
