"""Interlaced scans: coarse first, the same rows in the recording, and the same bytes after a stop."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.acquisition import reprocess
from picoradar.instrument.acquisition.order import LineOrder
from picoradar.instrument.cli.main import run
from picoradar.instrument.controller import STATE_EVENT
from picoradar.instrument.recording import Recording

SCAN = (
    "scan",
    "--target",
    "hip",
    "--grid",
    "18x7",
    "--step-mm",
    "3.5",
    "--order",
    "interlaced",
    "--mode",
    "window",
    "--seed",
    "4",
    "--json",
)
NAMES = ("points_mm", "covariance_mm2", "range_mm", "range_variance_mm2", "response_mv", "flags", "rows", "columns")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("interlaced") / "whole.db"
    assert run([*SCAN, "-o", str(path)]) == 0
    return path


def same(one: Path, other: Path) -> None:
    with Recording.open(one) as first, Recording.open(other) as second:
        assert first.done == second.done
        clouds = first.cloud(), second.cloud()
    for name in NAMES:
        assert np.array_equal(getattr(clouds[0], name), getattr(clouds[1], name), equal_nan=True), name


def test_lines_are_taken_coarse_first_and_keep_their_rows(whole: Path) -> None:
    with Recording.open(whole) as recording:
        lines = list(recording.lines(traces=False))
        events = [event.fields["line"] for event in recording.events() if event.kind == STATE_EVENT]
        assert recording.raster["order"] == "interlaced"
    expected = LineOrder(18, "interlaced").lines
    assert tuple(line.index for line in sorted(lines, key=lambda line: line.device_time_s)) == expected
    assert tuple(events) == expected
    y_mm = [float(np.nanmean(line.points_mm[:, 1])) for line in lines]
    assert all(below < above for above, below in itertools.pairwise(y_mm))  # rows go from top to bottom


@pytest.mark.parametrize("pulse", [4000, 9500])
def test_an_interlaced_scan_goes_on_to_the_same_bytes(
    pulse: int, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, fault = tmp_path / "broken.db", tmp_path / "lid.json"
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": {"pulse": pulse}}]}), encoding="utf-8")
    assert run([*SCAN, "-o", str(path), "--faults", str(fault)]) in (3, 4)
    with Recording.open(path) as broken_off:
        done = broken_off.done
    assert 0 < len(done) < 18
    assert sorted(done) == sorted(LineOrder(18, "interlaced").lines[: len(done)])
    assert run(["resume", str(path), "--json"]) == 0, capsys.readouterr().err
    same(path, whole)


def test_reprocessing_judges_neighbours_as_the_scan_did(whole: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.db"
    reprocess(whole, again)
    same(again, whole)
