"""The range zero is checked in every scan, and no error of it gets a `pass`."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from picoradar.instrument.acquisition import zero_check_of
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.cli import scanning, session
from picoradar.instrument.cli.main import run
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording, RecordingError, salvage
from picoradar.instrument.settings import Settings, override
from picoradar.sim.physics import HIP_FILE
from tests.system.conftest import Told

WINDOWS = ("--grid", "20x20", "--step-mm", "2", "--mode", "window", "--seed", "7", "--material", "bone")
SHORT = ("--grid", "3x2", "--seed", "7")
DRIFT_MM = 4.0  # of the reference fibre: all ranges are off by half of it


def settings_file(folder: Path, **tables: dict[str, object]) -> Path:
    path = folder / "settings.toml"
    lines = []
    for table, values in tables.items():
        lines += [f"[{table}]", *(f"{key} = {json.dumps(value)}" for key, value in values.items())]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def drifted(folder: Path) -> Path:
    return settings_file(folder, simulation={"reference_path_mm": 1031.4 + DRIFT_MM})


@pytest.fixture(scope="module")
def scanned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scanned") / "scan.db"
    assert run(["scan", *WINDOWS, "-o", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def off_by_2_mm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    right = session.calibration_of(Settings())
    path = tmp_path_factory.mktemp("off") / "calibration.json"
    right.model_copy(update={"range_zero_mm": right.range_zero_mm + 2.0}).save(path)
    return path


@pytest.mark.parametrize("mode", ["sweep", "window"])
def test_a_scan_is_checked_before_its_first_line_and_after_its_last(mode: str, tmp_path: Path, told: Told) -> None:
    check = told("scan", *SHORT, "--mode", mode, "-o", tmp_path / "scan.db")["zero_check"]
    assert (check["outcome"], check["by"]) == ("passed", "mark")
    assert abs(check["largest_mm"]) < check["limit_mm"] < 1.0
    with Recording.open(tmp_path / "scan.db") as recording:
        assert [reading.lines for reading in recording.zero_readings()] == [0, 3]
        assert {reading.mark_mm for reading in recording.zero_readings()} == {675.0}
        assert all((r.windows is None) is (mode == "sweep") for r in recording.zero_readings())
    assert told("info", tmp_path / "scan.db")["zero_check"] == check


@pytest.mark.parametrize("mode", ["sweep", "window"])
def test_a_radar_that_has_drifted_is_found_out(mode: str, tmp_path: Path, told: Told) -> None:
    scan = ("scan", "--settings", drifted(tmp_path), *SHORT, "--mode", mode, "-o", tmp_path / "scan.db")
    check = told(*scan)["zero_check"]
    assert check["outcome"] == "failed"
    assert check["largest_mm"] == pytest.approx(-DRIFT_MM / 2, abs=0.7)


def test_a_sound_scan_passes_and_no_error_of_the_range_zero_does(
    scanned: Path, off_by_2_mm: Path, tmp_path: Path, told: Told
) -> None:
    sound = told("register", scanned, HIP_FILE)
    assert (sound["verdict"], sound["zero_check"]["outcome"]) == ("pass", "passed")

    told("reprocess", scanned, "-o", tmp_path / "again.db", "--calibration", off_by_2_mm)
    again = told("register", tmp_path / "again.db", HIP_FILE, code=1)
    assert again["verdict"] == "fail"
    assert again["zero_check"]["largest_mm"] == pytest.approx(2.0, abs=0.5)
    assert again["reasons"][0].startswith("The mark of known range reads +")

    told("scan", "--settings", drifted(tmp_path), *WINDOWS, "-o", tmp_path / "drifted.db")
    assert told("register", tmp_path / "drifted.db", HIP_FILE, code=1)["verdict"] == "fail"


def test_without_a_check_there_is_no_pass(scanned: Path, tmp_path: Path, told: Told) -> None:
    unmarked = settings_file(tmp_path, scanner={"zero_mark": False})
    told("scan", "--settings", unmarked, *WINDOWS, "-o", tmp_path / "unmarked.db")
    older = tmp_path / "layout2.db"
    older.write_bytes(scanned.read_bytes())
    with sqlite3.connect(older) as database:
        database.executescript("DROP TABLE zero; PRAGMA user_version=2;")
    database.close()
    for path in (tmp_path / "unmarked.db", older):
        found = told("register", path, HIP_FILE)
        assert (found["verdict"], found["zero_check"]["outcome"]) == ("caution", "none")
        assert any("bench zero" in reason for reason in found["reasons"])


def test_points_of_another_program_have_no_radar_to_check(scanned: Path, tmp_path: Path, told: Told) -> None:
    told("export", scanned, "-o", tmp_path / "cloud.csv")
    table = (tmp_path / "cloud.csv").read_text().splitlines()
    (tmp_path / "other.csv").write_text("\n".join(row for row in table if not row.startswith("#")))
    found = told("register", tmp_path / "other.csv", HIP_FILE)
    assert (found["zero_check"], found["range_error"]["source"]) == (None, None)


def test_a_calibration_without_the_mark_is_judged_by_the_mark_that_was_recorded(
    scanned: Path, off_by_2_mm: Path, tmp_path: Path, told: Told
) -> None:
    bare = tmp_path / "bare.json"
    Calibration.load(off_by_2_mm).model_copy(update={"zero_mark": None}).save(bare)
    check = told("reprocess", scanned, "-o", tmp_path / "again.db", "--calibration", bare)["zero_check"]
    assert check["outcome"] == "failed"


def test_a_hidden_mark_is_no_check(tmp_path: Path, told: Told) -> None:
    absent = settings_file(tmp_path, simulation={"zero_mark_mm": 0.0})
    check = told("scan", "--settings", absent, *SHORT, "-o", tmp_path / "scan.db")["zero_check"]
    assert check["outcome"] == "none"
    assert "was not found" in check["sentence"]


def scan_with(sink: Callable[[session.Session, ScanLine], None], path: Path) -> Any:
    """Scan six lines; the sink gets each."""
    with session.session(override(Settings(), {"scan": {"rows": 6, "columns": 2}}), None) as open_bench:
        session.warm_up(open_bench)
        scan = open_bench.controller.scan
        open_bench.controller.scan = lambda job, store, sinks: scan(  # type: ignore[method-assign]
            job, store, [*sinks, lambda line: sink(open_bench, line)]
        )
        return scanning.record_scan(open_bench, path).described


def test_a_drift_during_the_scan_is_found_out_at_its_end(tmp_path: Path) -> None:
    def warm(bench: session.Session, line: ScanLine) -> None:
        if line.index == 2 and bench.simulated is not None:
            optics = bench.simulated.bench.optics
            optics._settings = optics._settings.model_copy(update={"reference_path_mm": 1031.4 + DRIFT_MM})
            optics._reference.cache_clear()

    check = scan_with(warm, tmp_path / "scan.db")["zero_check"]
    assert check["outcome"] == "failed"
    assert "after 6 lines" in check["sentence"]
    assert check["moved_mm"] == pytest.approx(-DRIFT_MM / 2, abs=0.8)


def test_a_scan_that_is_finished_early_is_checked_at_its_end_as_well(tmp_path: Path) -> None:
    def finish(bench: session.Session, line: ScanLine) -> None:
        if line.index == 2:
            bench.controller.request("finish")

    found = scan_with(finish, tmp_path / "scan.db")
    assert (found["stop_reason"], found["lines"], found["zero_check"]["outcome"]) == ("finished early", 3, "passed")


def test_a_finish_after_the_last_line_changes_nothing(tmp_path: Path) -> None:
    def finish(bench: session.Session, line: ScanLine) -> None:
        if line.index == 5:
            bench.controller.request("finish")

    found = scan_with(finish, tmp_path / "scan.db")
    assert (found["stop_reason"], found["lines"], found["zero_check"]["outcome"]) == ("complete", 6, "passed")


def test_a_scan_that_was_broken_off_is_not_checked_until_it_has_been_gone_on_with(tmp_path: Path, told: Told) -> None:
    fault, path = tmp_path / "lid.json", tmp_path / "scan.db"
    at = {"pulse": 1 + (2 + 3) * 8 * 1446}  # two records of the mark, then the middle of the second line
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": at}]}), encoding="utf-8")
    assert run(["scan", *SHORT, "-o", str(path), "--faults", str(fault)]) == 4
    with Recording.open(path) as broken_off:
        assert [reading.lines for reading in broken_off.zero_readings()] == [0]
        check = zero_check_of(broken_off)
        assert check.outcome == "none"
        assert "not after its last line" in check.sentence
    assert told("resume", path)["zero_check"]["outcome"] == "passed"
    with Recording.open(path) as whole:
        assert [reading.lines for reading in whole.zero_readings()] == [0, 1, 3]


def test_an_interlock_during_the_first_check_ends_the_scan_like_one_during_a_line(tmp_path: Path) -> None:
    fault, path = tmp_path / "lid.json", tmp_path / "scan.db"
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": {"pulse": 5000}}]}), encoding="utf-8")
    assert run(["scan", *SHORT, "-o", str(path), "--faults", str(fault)]) == 4
    with Recording.open(path) as broken_off:
        assert broken_off.laser_off_verified
        assert (broken_off.done, broken_off.zero_readings()) == ([], [])


def test_a_damaged_reading_is_no_check_and_costs_no_line(scanned: Path, tmp_path: Path, told: Told) -> None:
    for number, damage in enumerate(("mark_mm = 677", "data = zeroblob(40)", "lines = 'x'", "x_rad = x''", "n = -1")):
        path = tmp_path / f"damaged{number}.db"
        path.write_bytes(scanned.read_bytes())
        with sqlite3.connect(path) as database:
            database.execute(f"UPDATE zero SET {damage} WHERE id = 1")
        database.close()
        result = told("info", path)
        assert result["zero_check"]["outcome"] == "none", damage
        assert result["lines_ok"] == 20
        with Recording.open(path) as recording, pytest.raises(RecordingError, match="zero mark is damaged"):
            recording.zero_readings()


def test_a_salvaged_recording_keeps_its_check(scanned: Path, tmp_path: Path) -> None:
    copy = tmp_path / "scan.db"
    copy.write_bytes(scanned.read_bytes())
    new, _, lost = salvage(copy)
    with Recording.open(new) as salvaged, Recording.open(scanned) as before:
        assert not lost
        assert zero_check_of(salvaged) == zero_check_of(before)


@pytest.fixture
def plate(tmp_path: Path, told: Told) -> Callable[..., dict[str, Any]]:
    """Check the range zero on a plate, and scan with the calibration that this has made, without a mark."""

    def scan(*options: str) -> dict[str, Any]:
        told("bench", "zero", "--distance-mm", "750", "--range-sd-mm", "0.1", "--out", tmp_path / "zero", *options)
        calibration = tmp_path / "zero" / "calibration.json"
        settings = tmp_path / "plate.toml"
        settings.write_text(f"calibration = {json.dumps(str(calibration))}\n[scanner]\nzero_mark = false\n", "utf-8")
        return told("scan", "--settings", settings, *SHORT, "-o", tmp_path / "plate.db")

    return scan


def test_where_a_radar_has_no_mark_a_plate_checks_it_for_some_hours(
    plate: Callable[..., dict[str, Any]], off_by_2_mm: Path, tmp_path: Path, told: Told
) -> None:
    check = plate()["zero_check"]
    assert (check["outcome"], check["by"]) == ("passed", "plate")
    again = ("reprocess", tmp_path / "plate.db", "-o", tmp_path / "again.db", "--calibration", off_by_2_mm)
    check = told(*again)["zero_check"]
    assert check["outcome"] == "failed"
    assert check["largest_mm"] == pytest.approx(2.0, abs=0.1)


def test_a_check_on_a_plate_that_is_older_than_the_settings_allow_is_none(
    plate: Callable[..., dict[str, Any]],
) -> None:
    check = plate("--date", "2026-01-31T12:00:00Z")["zero_check"]
    assert (check["outcome"], check["by"]) == ("none", "plate")
    assert "scanner.zero_hours" in check["sentence"]


def test_bench_zero_refuses_a_radar_that_has_drifted(tmp_path: Path, told: Told) -> None:
    settings = settings_file(tmp_path, simulation={"reference_path_mm": 1031.4 + DRIFT_MM, "target": "plate"})
    result = told("bench", "zero", "--settings", settings, "--out", tmp_path / "zero", code=1)
    assert result["calibration"] is None
    assert result["figures"]["template_difference_mm"] == pytest.approx(-DRIFT_MM / 2, abs=0.1)


def test_options_of_bench_zero_are_for_no_other_procedure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["bench", "drift", "--range-sd-mm", "0.1", "--out", str(tmp_path / "drift")]) == 2
    assert "bench zero" in capsys.readouterr().err
