"""`picoradar bench` and `picoradar calibration` on the command line: refusals, Ctrl-C, comparisons, broken files."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from picoradar.instrument.cli.main import run as command
from picoradar.instrument.procedures import PROCEDURES
from picoradar.instrument.procedures.gray_target import procedure as gray_target


def test_the_command_refuses_unknown_names_and_folders_that_exist(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["bench", "grey-target"]) == 2
    assert "gray-target" in capsys.readouterr().err
    assert command(["bench", "scanner", "--out", str(tmp_path)]) == 2
    assert command(["bench", "scanner", "--out", str(tmp_path / "x"), "--date", "yesterday"]) == 2
    assert not (tmp_path / "x").exists()


def test_the_help_names_every_procedure(capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["bench", "--help"]) == 0
    shown = capsys.readouterr().out.split("Procedures:")[1]
    assert all(name in shown for name in PROCEDURES)


def test_ctrl_c_ends_a_procedure_safely(tmp_path: Path) -> None:
    folder = tmp_path / "drift"
    process = subprocess.Popen(
        [sys.executable, "-m", "picoradar.instrument.cli", "bench", "drift", "--out", str(folder)],
        stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    end = time.monotonic() + 40
    while not (folder / "raw" / "bright.db").exists() and time.monotonic() < end:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=40)
    assert process.returncode == 130, stderr
    assert "laser off verified" in stderr


def test_the_calibration_command_compares_and_judges(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["calibration", "status", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["out_of_date"] is False
    file = tmp_path / "calibration.json"
    warm = tmp_path / "warm.toml"
    warm.write_text("[diode]\ntarget_degc = 24.0\n")
    assert command(["calibration", "status", "--settings", str(warm), "--json"]) == 1
    assert "run gray-target" in json.loads(capsys.readouterr().out)["reasons"][0]
    shipped = Path(gray_target.__file__).parents[2] / "data" / "simulated-bench.json"
    file.write_bytes(shipped.read_bytes())
    assert command(["calibration", "compare", str(shipped), str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["same"] == "yes"
    assert command(["calibration", "list", str(tmp_path), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["calibrations"]) == 1


def test_a_report_keeps_what_the_run_was_made_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = tmp_path / "g3b.toml"
    settings.write_text('[simulation]\ntarget = "plate"\nlinearity_percent = 0.3\n')
    folder = tmp_path / "scanner"
    status = command(["bench", "scanner", "--settings", str(settings), "--seed", "7", "--out", str(folder), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert status == (0 if found["passed"] else 1)
    kept = json.loads((folder / "figures.json").read_text())
    assert kept["seed"] == 7
    assert kept["settings_digest"].startswith("sha256:")
    assert "linearity_percent = 0.3" in (folder / "settings.toml").read_text()
    assert "Next" in (folder / "report.html").read_text(encoding="utf-8")
    assert not list(folder.glob("*.partial"))


@pytest.mark.parametrize("content", [b"", b'{"format": 1, "date"', b"\x00\xff\xfe", b"[1, 2]", b"drive_v = 290\n"])
def test_a_broken_calibration_is_named_and_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes
) -> None:
    file = tmp_path / "broken-calibration.json"
    file.write_bytes(content)
    shipped = Path(gray_target.__file__).parents[2] / "data" / "simulated-bench.json"
    assert command(["calibration", "show", str(file)]) == 2
    assert command(["calibration", "compare", str(shipped), str(file)]) == 2
    assert capsys.readouterr().err.count("broken-calibration.json") == 2
    assert command(["calibration", "list", str(tmp_path), "--json"]) == 0
    seen = capsys.readouterr()
    assert json.loads(seen.out)["calibrations"] == []
    assert "left out" in seen.err
