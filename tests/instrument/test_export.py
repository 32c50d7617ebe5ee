"""Export: the points of a recording in other programs' formats, whole or not at all."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.files.export import ExportError, export
from picoradar.instrument.files.export.safely import write_safely
from picoradar.instrument.files.points import read_points
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.recording import Recording, RecordingError

HEADER = {
    "raster": {"rows": 3, "columns": 5, "step_mm": 1.0, "mode": "sweep", "averages": 8},
    "trace": {"start_ps": 6500.0, "step_ps": 6.7, "samples": 40, "zero_code": 40.0, "mv_per_code": 0.5},
}


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
                traces=Trace(
                    rng.integers(0, 2040, (5, 40)).astype(np.uint16),
                    8,
                    6500.0 + 6.7 * np.arange(40),
                    CodeScale(40.0, 0.5),
                ),
                sweeps=8,
                device_time_s=float(k),
            )
        )
    recording.finish("finished", laser_off_verified=True)
    yield recording
    recording.close()


@pytest.mark.parametrize("suffix", [".ply", ".csv", ".npz", ".PLY"])
def test_points_come_back_to_the_last_bit(recording: Recording, tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"cloud{suffix}"
    assert export(recording, target) == {"written": str(target), "points": 12, "two_echoes": 0}
    found = read_points(target)
    cloud = recording.cloud().with_range()
    assert np.array_equal(found.points, cloud.points_mm)
    assert found.response_mv is not None
    assert np.array_equal(found.response_mv, cloud.response_mv)
    assert found.grid is not None
    assert np.array_equal(found.grid, cloud.grid)


@pytest.mark.skipif(os.name == "nt", reason="modes of files are POSIX")
@pytest.mark.parametrize("suffix", [".ply", ".csv", ".npz", ".h5", ".las", ".zarr"])
def test_points_are_as_private_as_the_recording(recording: Recording, tmp_path: Path, suffix: str) -> None:
    for module in {".h5": ["h5py"], ".las": ["laspy"], ".zarr": ["zarr"]}.get(suffix, []):
        pytest.importorskip(module)
    assert recording.path.stat().st_mode & 0o777 == 0o600
    target = tmp_path / f"cloud{suffix}"
    if suffix != ".zarr":
        target.write_text("of an earlier version, for everybody")
        target.chmod(0o666)
    before = os.umask(0)
    try:
        export(recording, target)
    finally:
        os.umask(before)
    written = [target, *target.rglob("*")]
    assert {oct(path.stat().st_mode & 0o777) for path in written if path.is_file()} == {"0o600"}
    assert {oct(path.stat().st_mode & 0o777) for path in written if path.is_dir()} <= {"0o700"}
    assert not list(tmp_path.glob(".*"))


@pytest.mark.skipif(os.name == "nt", reason="modes of files are POSIX")
def test_nobody_can_look_in_while_it_is_written(recording: Recording, tmp_path: Path) -> None:
    seen = []

    def write(path: Path) -> None:
        path.write_text("a patient")
        seen.append(path.parent.stat().st_mode & 0o777)

    write_safely(tmp_path / "cloud.csv", write, lambda path: path.read_text() == "a patient")
    assert seen == [0o700]


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


def test_las_keeps_a_hundredth_of_a_micrometre(recording: Recording, tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="LAS export needs the extra `formats`")
    assert export(recording, tmp_path / "cloud.las")["points"] == 12
    las = laspy.read(tmp_path / "cloud.las")
    cloud = recording.cloud().with_range()
    assert np.allclose(las.xyz, cloud.points_mm, rtol=0, atol=6e-6)
    assert np.array_equal(las["response_mv"], cloud.response_mv)
    assert las.intensity[0] == round(cloud.response_mv[0] * 100)


def open_tree(path: Path) -> Any:
    if path.suffix == ".h5":
        return pytest.importorskip("h5py", reason="HDF5 export needs the extra `formats`").File(path)
    return pytest.importorskip("zarr", reason="Zarr export needs the extra `formats`").open_group(str(path), mode="r")


@pytest.mark.parametrize("suffix", [".h5", ".zarr"])
@pytest.mark.parametrize("waveforms", [False, True])
def test_trees_hold_points_and_traces(recording: Recording, tmp_path: Path, suffix: str, waveforms: bool) -> None:
    target = tmp_path / f"scan{suffix}"
    pytest.importorskip({".h5": "h5py", ".zarr": "zarr"}[suffix], reason="needs the extra `formats`")
    export(recording, target, waveforms=waveforms)
    export(recording, target, waveforms=waveforms)  # an older one is replaced
    root = open_tree(target)
    cloud = recording.cloud().with_range()
    assert np.array_equal(root["points"]["points_mm"][...], cloud.points_mm)
    assert np.array_equal(root["points"]["covariance_mm2"][...], cloud.covariance_mm2)
    assert json.loads(root.attrs["header"])["raster"]["rows"] == 3
    assert ("traces" in root) == waveforms
    if waveforms:
        traces = root["traces"]
        assert traces["sums"].shape == (15, 40)
        assert np.array_equal(traces["sums"][5:10], recording.line(1).sums)
        assert traces["column"][5:10].tolist() == [4, 3, 2, 1, 0]
        assert traces["flags"][6] == Flag.NO_ECHO
        assert traces.attrs["step_ps"] == 6.7
    if suffix == ".h5":
        root.close()


@pytest.mark.parametrize("suffix", [".las", ".h5"])
def test_the_same_recording_gives_the_same_bytes_in_other_formats_too(
    recording: Recording, tmp_path: Path, suffix: str
) -> None:
    pytest.importorskip({".h5": "h5py", ".las": "laspy"}[suffix], reason="needs the extra `formats`")
    one, two = tmp_path / f"one{suffix}", tmp_path / f"two{suffix}"
    export(recording, one)
    export(recording, two)
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.parametrize(("suffix", "name"), [(".h5", "h5py"), (".las", "laspy"), (".zarr", "zarr")])
def test_a_missing_library_is_named_with_its_remedy(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, name: str
) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ExportError, match=rf"needs the library {name}.*pip install 'picoradar\[formats\]'"):
        export(recording, tmp_path / f"cloud{suffix}")
    assert [entry.name for entry in tmp_path.iterdir()] == ["scan.db"]


def test_csv_has_units_in_its_names(recording: Recording, tmp_path: Path) -> None:
    export(recording, tmp_path / "cloud.csv")
    first = (tmp_path / "cloud.csv").read_text().splitlines()[0]
    assert first == (
        "x_mm,y_mm,z_mm,response_mv,range_variance_mm2,flags,row,column,range_mm,"
        "last_x_mm,last_y_mm,last_z_mm,last_range_mm,last_range_variance_mm2,last_response_mv,range_covariance_mm2"
    )


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
    with pytest.raises(ExportError, match=r"'\.step' is not known; use one of \.ply \.csv \.npz \.las"):
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


@pytest.mark.parametrize("suffix", [".ply", ".csv", ".npz", ".las", ".h5", ".zarr"])
def test_a_recording_without_points_gives_a_file_without_points(tmp_path: Path, suffix: str) -> None:
    if library := {".h5": "h5py", ".las": "laspy", ".zarr": "zarr"}.get(suffix):
        pytest.importorskip(library, reason="needs the extra `formats`")
    with Recording.create(tmp_path / "empty.db", HEADER) as recording:
        assert export(recording, tmp_path / f"cloud{suffix}")["points"] == 0


def test_traces_that_were_not_recorded_are_missed_in_words(tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="HDF5 export needs the extra `formats`")
    for name, header, refusal, words in (
        ("empty", HEADER, ExportError, "holds no line"),
        ("plain", {"raster": HEADER["raster"]}, RecordingError, "nothing about traces"),
    ):
        recording = Recording.create(tmp_path / f"{name}.db", header)
        with pytest.raises(refusal, match=words):
            export(recording, tmp_path / "scan.h5", waveforms=True)
        recording.close()
    assert not (tmp_path / "scan.h5").exists()
