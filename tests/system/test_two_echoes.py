"""Two surfaces under one spot, from the scan to every file: both ranges are there, and both are true."""

from __future__ import annotations

import json
import signal
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from benchmarks.faults import resumes
from benchmarks.two_echoes import FRONT_MM, over_an_edge, sure
from picoradar.instrument.cli.main import run
from picoradar.instrument.files.points import read_points
from picoradar.instrument.line import LAST_ECHO, Flag
from picoradar.instrument.recording import Cloud, Recording
from tests.system.conftest import Told

BACK_MM = 960.0  # along z, as that of the front: two plates at right angles to the middle beam, with an edge between
SEED = 5


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    return over_an_edge(tmp_path_factory.mktemp("scene"), BACK_MM - FRONT_MM, SEED)


@pytest.fixture(scope="module")
def scanned(scene: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scanned") / "scan.db"
    assert run([*scene, "--material", "paint", "-o", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def places(scanned: Path) -> Cloud:
    with Recording.open(scanned) as recording:
        return recording.cloud().with_range()


def test_both_ranges_are_true(places: Cloud) -> None:
    two = places.where(places.two_echoes)
    assert 8 < len(two) < len(places) - 8
    assert ((two.flags & np.uint16(Flag.MIXED)) != 0).all()
    bright = sure(two)
    assert len(bright) > 8
    errors = (bright.points_mm[:, 2] - FRONT_MM, bright.last_points_mm[:, 2] - BACK_MM)
    variances = (bright.range_variance_mm2, bright.last_range_variance_mm2)
    for error, variance in zip(errors, variances, strict=True):
        assert np.abs(error.mean()) < 0.2
        assert np.abs(error).max() < 1.0
        assert np.mean(error**2 / variance) < 3.0
    assert np.allclose(np.cross(two.points_mm, two.last_points_mm) / BACK_MM**2, 0, atol=1e-4)  # on one beam
    assert (two.range_covariance_mm2**2 < two.range_variance_mm2 * two.last_range_variance_mm2).all()


@pytest.mark.parametrize("gap_mm", [35.0, 80.0])
def test_the_echoes_are_as_far_apart_as_the_surfaces(told: Told, tmp_path: Path, gap_mm: float) -> None:
    told(*over_an_edge(tmp_path, gap_mm, SEED), "-o", tmp_path / "scan.db")
    with Recording.open(tmp_path / "scan.db") as recording:
        cloud = recording.cloud()
    bright = sure(cloud)
    assert len(bright) > 4
    apart = bright.last_range_mm - bright.range_mm - gap_mm
    variance = bright.range_variance_mm2 + bright.last_range_variance_mm2 - 2 * bright.range_covariance_mm2
    assert np.abs(apart.mean()) < 0.3
    assert 0.2 < np.mean(apart**2 / variance) < 3.0


def test_the_commands_say_how_many(scanned: Path, scene: list[str], places: Cloud, told: Told) -> None:
    count = int(places.two_echoes.sum())
    assert told("info", scanned)["two_echoes"] == count
    again = told(*scene, "--material", "paint", "-o", scanned.with_name("again.db"))
    assert (again["two_echoes"], again["points"]) == (count, len(places))


@pytest.mark.parametrize("suffix", [".ply", ".csv", ".npz"])
def test_point_files_have_both_and_readers_take_the_first(
    scanned: Path, places: Cloud, told: Told, tmp_path: Path, suffix: str
) -> None:
    target = tmp_path / f"cloud{suffix}"
    count = int(places.two_echoes.sum())
    assert told("export", scanned, "-o", target) == {
        "written": str(target),
        "points": len(places),
        "two_echoes": count,
    }
    found = read_points(target)
    assert np.array_equal(found.points, places.points_mm)
    table: Any = {
        ".ply": lambda: trimesh.load(target).metadata["_ply_raw"]["vertex"]["data"],
        ".csv": lambda: np.genfromtxt(target, delimiter=",", names=True),
        ".npz": lambda: np.load(target, allow_pickle=False),
    }[suffix]()
    for name in ("range_mm", *LAST_ECHO):
        if name != "last_points_mm" or suffix == ".npz":
            assert np.array_equal(table[name], getattr(places, name), equal_nan=True), name
    if suffix != ".npz":
        unit = "_mm" if suffix == ".csv" else ""
        last = np.column_stack([table[f"last_{axis}{unit}"] for axis in "xyz"])
        assert np.array_equal(last, places.last_points_mm, equal_nan=True)


def test_in_las_each_echo_is_a_return(scanned: Path, places: Cloud, told: Told, tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="LAS export needs the extra `formats`")
    two, count = places.two_echoes, int(places.two_echoes.sum())
    assert told("export", scanned, "-o", tmp_path / "cloud.las")["points"] == len(places)
    las = laspy.read(tmp_path / "cloud.las")
    number, total = np.asarray(las.return_number), np.asarray(las.number_of_returns)
    assert len(las.points) == len(places) + count
    assert las.header.number_of_points_by_return[:3].tolist() == [len(places), count, 0]
    first, last = number == 1, number == 2
    assert np.array_equal(total[first], 1 + two)
    assert (total[last] == 2).all()
    assert np.array_equal(np.flatnonzero(last), np.flatnonzero(first & (total == 2)) + 1)  # side by side
    for chosen, points, values in (
        (first, places.points_mm, (places.range_mm, places.range_variance_mm2, places.response_mv)),
        (
            last,
            places.last_points_mm[two],
            (places.last_range_mm[two], places.last_range_variance_mm2[two], places.last_response_mv[two]),
        ),
    ):
        assert np.allclose(las.xyz[chosen], points, rtol=0, atol=6e-6)
        for name, value in zip(("range_mm", "range_variance_mm2", "response_mv"), values, strict=True):
            assert np.array_equal(las[name][chosen], value)
        assert np.array_equal(las["range_sd_mm"][chosen], np.sqrt(values[1]))
    assert np.array_equal(las["row"][last], places.rows[two])
    assert np.array_equal(las["column"][last], places.columns[two])


@pytest.mark.parametrize("suffix", [".h5", ".zarr"])
def test_trees_have_both(scanned: Path, places: Cloud, told: Told, tmp_path: Path, suffix: str) -> None:
    library = pytest.importorskip({".h5": "h5py", ".zarr": "zarr"}[suffix], reason="needs the extra `formats`")
    target = tmp_path / f"scan{suffix}"
    told("export", scanned, "-o", target)
    root = library.File(target, "r") if suffix == ".h5" else library.open_group(str(target), mode="r")
    for name in LAST_ECHO:
        assert np.array_equal(root["points"][name][...], getattr(places, name), equal_nan=True)
    assert json.loads(root.attrs["range_error"])["material"] == "paint"


def rows(path: Path) -> list[list[tuple[object, ...]]]:
    with sqlite3.connect(path) as raw:
        found = [raw.execute(f"SELECT {what} ORDER BY k").fetchall() for what in ("k, n, data FROM echo",
                 "k, n, sweeps, crc32, points FROM line")]  # fmt: skip
    raw.close()
    return found


@pytest.mark.parametrize(("mode", "lines"), [("sweep", 1), ("sweep", 3), ("window", 2)])
def test_a_killed_scan_goes_on_to_the_same_last_echoes(scene: list[str], tmp_path: Path, mode: str, lines: int) -> None:
    scan = [*scene, "--mode", mode, "-o"]
    whole, killed = tmp_path / "whole.db", tmp_path / "killed.db"
    assert resumes.in_a_process(lambda: resumes.quiet([*scan, str(whole)])) == 0
    assert resumes.in_a_process(lambda: resumes.scan_until(lines, [*scan, str(killed)])) == -signal.SIGKILL
    assert resumes.in_a_process(lambda: resumes.quiet(["resume", str(killed)])) == 0
    assert resumes.content(killed) == resumes.content(whole)
    (echoes, _), (again, _) = rows(whole), rows(killed)
    assert echoes
    assert again == echoes


@pytest.mark.parametrize("mode", ["sweep", "window"])
def test_reprocessed_from_raw_samples_they_are_the_same(
    scene: list[str], told: Told, tmp_path: Path, mode: str
) -> None:
    scan, again = tmp_path / "scan.db", tmp_path / "again.db"
    count = told(*scene, "--mode", mode, "-o", scan)["two_echoes"]
    assert count > 0
    assert told("reprocess", scan, "-o", again)["two_echoes"] == count
    assert rows(scan)[0] == rows(again)[0]
    if mode == "sweep":
        other = tmp_path / "half.db"
        assert told("reprocess", scan, "-o", other, "--estimator", "half-maximum")["two_echoes"] == 0
