"""Raw windows in a recording: back to the last bit, refused when damaged, and older files go on."""

from __future__ import annotations

import dataclasses
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from picoradar.drivers.traces import CodeScale, Window
from picoradar.instrument.files.export import export
from picoradar.instrument.line import LineWindows, ScanLine
from picoradar.instrument.recording import Recording, RecordingError

HEADER = {
    "raster": {"rows": 4, "columns": 3, "step_mm": 1.0, "mode": "window", "averages": 8},
    "trace": {"start_ps": 6500.0, "step_ps": 6.7, "samples": 1430, "zero_code": 32.0, "mv_per_code": 0.5},
}

SCALE = CodeScale(32.0, 0.5)


def make_windows(index: int) -> LineWindows:
    """Three places, the last of which was taken again with a wide window."""
    rng = np.random.default_rng(index)
    samples = np.array([[13, 20], [14, 21], [13, 12], [60, 160]], dtype=np.int32)
    return LineWindows(
        columns=np.array([0, 1, 2, 2], dtype=np.int32),
        retaken=np.array([False, False, False, True]),
        clipped=rng.random(4) < 0.5,
        start_ps=rng.integers(0, 4_000_000_000_000, (4, 2)) / 1000,
        step_ps=rng.integers(1000, 100_000, (4, 2)) / 1000,
        samples=samples,
        sweeps=rng.integers(1, 9, (4, 2)).astype(np.int32),
        sums=rng.integers(0, 2040, samples.sum()).astype(np.uint16),
        scale=SCALE,
    )


def make_line(index: int, windows: LineWindows | None) -> ScanLine:
    blank = np.full(3, 900.0)
    return ScanLine(
        index=index,
        columns=np.arange(3, dtype=np.int32),
        angles_rad=np.zeros((3, 2)),
        points_mm=np.full((3, 3), 900.0),
        covariance_mm2=np.tile(np.eye(3), (3, 1, 1)),
        range_mm=blank,
        range_variance_mm2=np.ones(3),
        response_mv=np.full(3, 40.0),
        flags=np.zeros(3, dtype=np.uint16),
        traces=None,
        sweeps=1,
        device_time_s=float(index),
        windows=windows,
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "scan.db"
    with Recording.create(file, HEADER) as recording:
        for index in range(4):
            recording.append(make_line(index, make_windows(index)))
        recording.finish("complete", laser_off_verified=True)
    return file


def same(a: LineWindows, b: LineWindows) -> bool:
    arrays = [field.name for field in dataclasses.fields(a) if field.name != "scale"]
    return a.scale == b.scale and all(
        np.array_equal(getattr(a, name), getattr(b, name)) and getattr(a, name).dtype == getattr(b, name).dtype
        for name in arrays
    )


def test_windows_come_back_to_the_last_bit(path: Path) -> None:
    with Recording.open(path) as recording:
        for index in range(4):
            found = recording.line(index).windows
            assert found is not None
            assert same(found, make_windows(index))
            assert recording.line(index, traces=False).windows is None
            assert [len(trace) for pair in found.traces_mv() for trace in pair] == [13, 20, 14, 21, 13, 12, 60, 160]
            again = found.where(found.retaken)
            first_mv = (again.sums[0] / again.sweeps[0, 0] - 32.0) * 0.5
            assert again.traces_mv()[0][0][0] == pytest.approx(first_mv)
            assert found.table()[-1][1] == Window(again.start_ps[0, 1], again.step_ps[0, 1], 160, again.sweeps[0, 1])
            assert same(found.where(~found.retaken).followed_by(found.where(found.retaken)), found)


@pytest.mark.parametrize(("table", "column"), [("window", "pieces"), ("window", "data")])
def test_a_flipped_bit_in_the_windows_is_found(path: Path, table: str, column: str) -> None:
    raw = sqlite3.connect(path)
    blob = bytearray(raw.execute(f"SELECT {column} FROM {table} WHERE k = 2").fetchone()[0])
    blob[len(blob) // 2] ^= 4
    raw.execute(f"UPDATE {table} SET {column} = ? WHERE k = 2", (bytes(blob),))
    raw.commit()
    raw.close()
    with Recording.open(path) as recording:
        assert [check.ok for check in recording.check()] == [True, True, False, True]
        with pytest.raises(RecordingError, match=r"line 2: the line is damaged: the check sum of the windows"):
            recording.line(2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sums": np.zeros(5, dtype=np.uint16)}, "5 sums for windows of 313 samples"),
        ({"sweeps": np.full((4, 2), 70_000, dtype=np.int32)}, "sweeps of a window is too large"),
        ({"start_ps": np.zeros((4, 2)), "samples": np.full((4, 2), -1, dtype=np.int32)}, "sums for"),
    ],
)
def test_windows_that_do_not_fit_are_refused(tmp_path: Path, change: dict[str, np.ndarray], said: str) -> None:
    with Recording.create(tmp_path / "bad.db", HEADER) as recording:
        with pytest.raises(RecordingError, match=said):
            recording.append(make_line(0, dataclasses.replace(make_windows(0), **change)))
        assert recording.done == []


def as_layout_1(path: Path) -> None:
    """Turn a recording into what the first layout was: without the table of windows."""
    raw = sqlite3.connect(path)
    raw.executescript("DROP TABLE window; DELETE FROM line WHERE k = 3; UPDATE scan SET stop_reason = NULL;")
    raw.execute("PRAGMA user_version=1")
    raw.commit()
    raw.close()


def test_a_recording_of_the_first_layout_still_opens_and_goes_on(path: Path) -> None:
    as_layout_1(path)
    with Recording.open(path) as old:
        assert [line.windows for line in old.lines()] == [None] * 3
        assert len(old.cloud()) == 9
        assert all(check.ok for check in old.check())
    with sqlite3.connect(path) as raw:
        assert raw.execute("PRAGMA user_version").fetchone() == (1,)  # reading has changed nothing
    raw.close()
    with Recording.resume(path) as going_on:
        assert going_on.missing == [3]
        going_on.append(make_line(3, make_windows(3)))
        going_on.finish("complete", laser_off_verified=True)
    with Recording.open(path) as whole:
        found = whole.line(3).windows
        assert found is not None
        assert same(found, make_windows(3))
        assert whole.line(0).windows is None


@pytest.mark.parametrize("suffix", [".h5", ".zarr"])
def test_windows_are_exported(path: Path, tmp_path: Path, suffix: str) -> None:
    library = pytest.importorskip({".h5": "h5py", ".zarr": "zarr"}[suffix], reason="needs the extra `formats`")
    target = tmp_path / f"scan{suffix}"
    with Recording.open(path) as recording:
        export(recording, target, waveforms=True)
    root = library.File(target, "r") if suffix == ".h5" else library.open_group(str(target), mode="r")
    group = root["windows"]
    arrays = {name: group[name][...] for name in group}
    assert "traces" not in root
    assert group.attrs["mv_per_code"] == 0.5
    assert arrays["row"].tolist() == [k for k in range(4) for _ in range(8)]
    assert arrays["column"][:8].tolist() == [0, 0, 1, 1, 2, 2, 2, 2]
    assert arrays["echo"][:4].tolist() == [0, 1, 0, 1]
    last = make_windows(3).sums[-160:]
    first = int(arrays["first"][-1])
    assert np.array_equal(arrays["sums"][first : first + int(arrays["samples"][-1])], last)
    if suffix == ".h5":
        root.close()
