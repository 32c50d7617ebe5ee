"""Export: the points of a recording in other programs' formats, whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from instrument.export import ExportError, export
from instrument.point_files import read_points
from instrument.recording import Recording
from instrument.scan_line import Flag, ScanLine

HEADER = {"raster": {"rows": 3, "columns": 5, "step_mm": 1.0, "mode": "sweep", "averages": 8}}


@pytest.fixture
def recording(tmp_path: Path) -> Iterator[Recording]:
    rng = np.random.default_rng(3)
    recording = Recording.create(tmp_path / "scan.db", HEADER)
    for k in range(3):
        flags = np.zeros(5, dtype=np.uint16)
        flags[k] = Flag.NO_ECHO
        points = rng.normal(size=(5, 3)) + [0, 0, 900]
        points[k] = np.nan
        recording.append(
            ScanLine(
                index=k,
                columns=np.arange(5, dtype=np.int32)[:: 1 if k % 2 == 0 else -1],
                angles_rad=rng.normal(size=(5, 2)),
                points_mm=points,
                covariance_mm2=np.tile(np.eye(3) * 0.07, (5, 1, 1)),
                range_mm=points[:, 2],
                range_variance_mm2=np.full(5, 0.07),
                response_mv=rng.uniform(30, 60, 5),
                flags=flags,
                sums=rng.integers(0, 2040, (5, 40)).astype(np.uint16),
                sweeps=8,
                device_time_s=float(k),
            )
        )
    recording.finish("finished", True)
    yield recording
    recording.close()


@pytest.mark.parametrize("suffix", [".ply", ".csv", ".npz", ".PLY"])
def test_points_come_back_to_the_last_bit(recording: Recording, tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"cloud{suffix}"
    assert export(recording, target) == {"written": str(target), "points": 12}
    found = read_points(target)
    cloud = recording.cloud().with_range()
    assert np.array_equal(found.points, cloud.points_mm)
    assert found.response_mv is not None
    assert np.array_equal(found.response_mv, cloud.response_mv)
    assert found.grid is not None
    assert np.array_equal(found.grid, cloud.grid)


def test_archive_carries_the_covariance(recording: Recording, tmp_path: Path) -> None:
    export(recording, tmp_path / "cloud.npz")
    found = read_points(tmp_path / "cloud.npz")
    assert found.covariance is not None
    assert np.array_equal(found.covariance, recording.cloud().with_range().covariance_mm2)
    assert found.origin is not None


def test_a_recording_is_a_point_file(recording: Recording) -> None:
    found = read_points(recording.path)
    assert np.array_equal(found.points, recording.cloud().with_range().points_mm)
    assert found.covariance is not None


@pytest.mark.parametrize("suffix", [".ply", ".csv", ".npz"])
def test_the_same_recording_gives_the_same_bytes(recording: Recording, tmp_path: Path, suffix: str) -> None:
    one, two = tmp_path / f"one{suffix}", tmp_path / f"two{suffix}"
    export(recording, one)
    export(recording, two)
    assert one.read_bytes() == two.read_bytes()


def test_csv_has_units_in_its_names(recording: Recording, tmp_path: Path) -> None:
    export(recording, tmp_path / "cloud.csv")
    first = (tmp_path / "cloud.csv").read_text().splitlines()[0]
    assert first == "x_mm,y_mm,z_mm,response_mv,range_variance_mm2,flags,row,column"


def test_ply_is_read_by_trimesh(recording: Recording, tmp_path: Path) -> None:
    import trimesh

    export(recording, tmp_path / "cloud.ply")
    vertices = trimesh.load(tmp_path / "cloud.ply").vertices
    assert np.allclose(vertices, recording.cloud().with_range().points_mm)


def test_an_older_file_is_replaced_and_nothing_is_left_behind(recording: Recording, tmp_path: Path) -> None:
    target = tmp_path / "cloud.csv"
    target.write_text("old")
    export(recording, target)
    assert target.read_text().startswith("x_mm")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["cloud.csv", "scan.db"]


def test_what_is_refused(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"'\.step' is not known; use one of \.ply \.csv \.npz"):
        export(recording, tmp_path / "cloud.step")
    with pytest.raises(ExportError, match="there is no folder"):
        export(recording, tmp_path / "nowhere" / "cloud.ply")
    with pytest.raises(ExportError, match="no place for traces"):
        export(recording, tmp_path / "cloud.ply", waveforms=True)
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(ExportError, match="is a folder"):
        export(recording, tmp_path / "folder.ply")


def test_the_recording_itself_is_never_overwritten(recording: Recording, tmp_path: Path) -> None:
    link = tmp_path / "scan.ply"
    os.link(recording.path, link)
    before = recording.path.read_bytes()
    with pytest.raises(ExportError, match="is the recording itself"):
        export(recording, link)
    assert recording.path.read_bytes() == before


def test_a_failing_disk_leaves_the_old_file(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "cloud.ply"
    target.write_text("old")

    def no_space(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(ExportError, match="No space left on device"):
        export(recording, target)
    assert target.read_text() == "old"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["cloud.ply", "scan.db"]
