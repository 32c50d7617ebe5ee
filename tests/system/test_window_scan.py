"""Window mode on the simulated bench: as good as a sweep, in a fraction of the time, and no place lost."""

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
    def _scan(name: str, *arguments: str) -> tuple[dict[str, Any], Path]:
        path = tmp_path / f"{name}.db"
        code = run(["scan", *arguments, "-o", str(path), "--json"])
        out, err = capsys.readouterr()
        assert code == 0, err
        return json.loads(out), path

    return _scan


def test_windows_reach_the_wanted_uncertainty_in_a_fiftieth_of_the_time(scan: Any) -> None:
    sweep, _ = scan("sweep", "--grid", "4x40")
    window, path = scan("window", "--grid", "4x40", "--mode", "window")
    assert window["mode"] == "window"
    assert window["points"] >= sweep["points"] * 0.995
    assert window["device_time_s"] < sweep["device_time_s"] / 35  # the first line still searches the whole range
    assert 0.05 < window["truth"]["range_rms_mm"] < 0.27
    assert abs(window["truth"]["range_bias_mm"]) < 0.05
    assert window["laser_off_verified"]
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    assert recording.header["raster"]["mode"] == "window"
    # The variances that the points carry are those that the scatter shows.
    assert np.sqrt(np.median(cloud.range_variance_mm2)) == pytest.approx(window["truth"]["range_rms_mm"], rel=0.35)


def test_no_place_is_lost_where_the_surface_jumps(scan: Any) -> None:
    window, path = scan("step", "--grid", "6x12", "--mode", "window", "--target", "step")
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    assert window["points"] == 72
    single = (cloud.flags & np.uint16(Flag.MIXED)) == 0
    assert single.sum() >= 60
    surface_mm = np.where(cloud.points_mm[:, 0] < 0, 890.0, 900.0)  # the body faces the scanner: its +x is our -x
    assert np.abs(cloud.points_mm[:, 2] - surface_mm)[single].max() < 1.0
    assert window["truth"]["range_max_mm"] < 1.0


def test_half_a_spot_beside_a_sloped_body_is_marked_and_not_taken_again_in_every_line(scan: Any) -> None:
    window, path = scan("prism", "--grid", "6x40", "--mode", "window", "--target", "prism")
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    mixed = (cloud.flags & np.uint16(Flag.MIXED)) != 0
    assert set(cloud.columns[mixed]) == {0, 39}  # the body is as wide as the raster
    assert mixed.sum() >= 10
    assert window["flags"].get("retaken", 0) <= 4
    assert window["truth"]["range_max_mm"] < 1.0


def test_the_same_seed_gives_the_same_windows(scan: Any) -> None:
    def cloud(name: str) -> np.ndarray:
        _, path = scan(name, "--grid", "2x5", "--mode", "window", "--seed", "4")
        with Recording.open(path) as recording:
            return recording.cloud().points_mm

    np.testing.assert_array_equal(cloud("a"), cloud("b"))


def test_points_taken_again_are_compared_with_the_truth_of_their_own_shots(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Some points of a prism that are taken again show two surfaces; they are left out, but were shots as well."""
    scan = ["scan", "--target", "prism", "--mode", "window", "--seed", "5", "--json"]
    assert run([*scan, "-o", str(tmp_path / "a.db")]) == 0
    truth = json.loads(capsys.readouterr().out)["truth"]
    with Recording.open(tmp_path / "a.db") as recording:
        cloud = recording.cloud()
    again = (cloud.flags & np.uint16(Flag.RETAKEN)) != 0
    mixed = (cloud.flags & np.uint16(Flag.MIXED)) != 0
    assert (again & mixed).any()
    assert (again & ~mixed).any()
    assert truth["range_rms_mm"] < 0.25
    assert truth["range_max_mm"] < 5 * 0.25  # it was 14.8 mm, with the truth of other shots
