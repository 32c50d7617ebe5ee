"""The recording: what is written comes back, what is damaged is told, what is acknowledged stays."""

from __future__ import annotations

import dataclasses
import sqlite3
import stat
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.recording import Recording, RecordingError
from picoradar.instrument.recording.layout import decode_wave, encode_wave

HEADER = {
    "settings": {"prf_hz": 80_000.0},
    "seed": 7,
    "run_id": "r1",
    "calibration": {"range_zero_mm": 12.5},
    "raster": {"rows": 4, "columns": 6, "step_mm": 1.0, "mode": "sweep", "averages": 8},
    "trace": {"start_ps": 6500.0, "step_ps": 6.7, "samples": 30, "zero_code": 40.0, "mv_per_code": 0.5},
}


def trace_of(sums: np.ndarray) -> Trace:
    return Trace(sums, 8, 6500.0 + 6.7 * np.arange(30), CodeScale(40.0, 0.5))


def make_line(index: int, *, columns: int = 6, samples: int | None = 30) -> ScanLine:
    rng = np.random.default_rng(index)
    flags = np.zeros(columns, dtype=np.uint16)
    flags[0] = Flag.NO_ECHO
    points = rng.normal(size=(columns, 3))
    points[0] = np.nan
    return ScanLine(
        index=index,
        columns=np.arange(columns, dtype=np.int32),
        angles_rad=rng.normal(size=(columns, 2)),
        points_mm=points,
        covariance_mm2=rng.normal(size=(columns, 3, 3)),
        range_mm=rng.uniform(890, 910, columns),
        range_variance_mm2=rng.uniform(0.05, 0.1, columns),
        response_mv=rng.uniform(20, 60, columns),
        flags=flags,
        traces=None if samples is None else trace_of(rng.integers(0, 2040, (columns, samples)).astype(np.uint16)),
        sweeps=8,
        device_time_s=10.0 + index,
    )


def same(a: ScanLine, b: ScanLine) -> bool:
    pairs = [(getattr(a, field.name), getattr(b, field.name)) for field in dataclasses.fields(a)]
    pairs += [(a.sums, b.sums)]
    pairs = [(x, y) for x, y in pairs if not isinstance(x, Trace)]
    return all(
        np.array_equal(x, y, equal_nan=np.asarray(x).dtype.kind == "f") if x is not None else y is None
        for x, y in pairs
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "scan with space #1?.db"


def write(path: Path, lines: int = 4, *, finish: bool = True, samples: int | None = 30) -> None:
    with Recording.create(path, HEADER) as recording:
        for k in range(lines):
            recording.append(make_line(k, samples=samples), acknowledged_at_s=11.0 + k)
        if finish:
            recording.finish("finished", laser_off_verified=True, device_time_s=14.0)


@pytest.mark.parametrize("samples", [None, 30])
def test_what_is_written_comes_back(path: Path, samples: int | None) -> None:
    write(path, samples=samples)
    with Recording.open(path) as recording:
        assert recording.header["settings"] == {"prf_hz": 80_000.0}
        assert recording.header["versions"]["numpy"] == np.__version__
        assert len(recording.header["calibration_digest"]) == 64
        assert all(same(line, make_line(line.index, samples=samples)) for line in recording.lines())
        assert recording.done == [0, 1, 2, 3]
        assert recording.complete
        assert recording.stop_reason == "finished"
        assert recording.laser_off_verified is True
        assert recording.summary == {"device_time_s": 14.0}
        assert all(check.ok for check in recording.check())


def test_32_bit_sums_and_short_lines_come_back(path: Path) -> None:
    line = dataclasses.replace(
        make_line(2), traces=trace_of(np.arange(180, dtype=np.uint32).reshape(6, 30) * 1_000_003)
    )
    with Recording.create(path, HEADER) as recording:
        recording.append(line)
        recording.append(make_line(0, columns=1))
        assert same(recording.line(2), line)
        assert recording.line(2, traces=False).sums is None
        assert recording.missing == [1, 3]


@settings(max_examples=60, deadline=None)
@given(
    sums=st.sampled_from([np.uint8, np.uint16, np.uint32]).flatmap(
        lambda kind: arrays(kind, st.tuples(st.integers(0, 5), st.integers(0, 40)))
    )
)
def test_any_sums_come_back(sums: np.ndarray) -> None:
    found = decode_wave(3, encode_wave(3, sums))
    assert found.dtype == sums.dtype
    assert np.array_equal(found, sums)


def test_traces_in_millivolts_and_their_times(path: Path) -> None:
    write(path, 1)
    with Recording.open(path) as recording:
        line = recording.line(0)
        assert line.sums is not None
        traces = recording.traces_mv(line)
        assert traces.shape == (6, 30)
        assert traces[2, 3] == pytest.approx((line.sums[2, 3] / 8 - 40.0) * 0.5)
        assert recording.times_ps[0] == 6500.0
        assert recording.times_ps[-1] == pytest.approx(6500.0 + 29 * 6.7)


def test_cloud_keeps_every_place_until_asked(path: Path) -> None:
    write(path)
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    assert len(cloud) == 24
    assert cloud.grid[7].tolist() == [1, 1]
    points = cloud.with_range()
    assert len(points) == 20
    assert np.isfinite(points.points_mm).all()
    assert points.covariance_mm2.shape == (20, 3, 3)


def test_cloud_of_a_recording_without_lines(path: Path) -> None:
    write(path, 0)
    with Recording.open(path) as recording:
        assert len(recording.cloud()) == 0
        assert not recording.complete


def test_events_come_back_in_order(path: Path) -> None:
    with Recording.create(path, HEADER) as recording:
        recording.event(1.0, "state", state="scanning", cause="start")
        recording.event(2.5, "alarm", quantity="diode", value=float("nan"), mask=np.uint16(3))
        first, second = recording.events()
    assert (first.time_s, first.kind, first.state, first.fields) == (1.0, "state", "scanning", {"cause": "start"})
    assert second.fields == {"quantity": "diode", "value": None, "mask": 3}


def test_one_file_is_left_and_only_its_owner_may_read_it(path: Path) -> None:
    write(path)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    if sys.platform != "win32":
        assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_a_reader_sees_lines_while_they_are_written_and_never_checkpoints(path: Path) -> None:
    with Recording.create(path, HEADER) as recording:
        recording.append(make_line(0))
        wal = Path(f"{path}-wal")
        before = wal.read_bytes()
        with Recording.open(path) as reader:
            assert reader.done == [0]
            recording.append(make_line(1))
            assert reader.done == [0, 1]
            assert reader.stop_reason is None
            with pytest.raises(RecordingError, match="opened for reading"):
                reader.append(make_line(2))
        assert wal.read_bytes().startswith(before[:4096])
        assert wal.stat().st_size > len(before)


def test_a_copy_without_the_log_is_a_scan_without_lines(path: Path, tmp_path: Path) -> None:
    with Recording.create(path, HEADER) as recording:
        recording.append(make_line(0))
        copied = tmp_path / "copied.db"
        copied.write_bytes(path.read_bytes())
        with Recording.open(copied) as alone:
            assert alone.done == []
            assert alone.header == recording.header
            assert not alone.complete


def test_finish_while_somebody_reads_keeps_all(path: Path) -> None:
    with Recording.create(path, HEADER) as recording:
        recording.append(make_line(0))
        with Recording.open(path) as reader:
            list(reader.lines())
            recording.finish("aborted", laser_off_verified=True)
            assert reader.stop_reason == "aborted"
    with Recording.open(path) as recording:
        assert recording.done == [0]


def test_resume_goes_on_to_the_same_cloud(path: Path, tmp_path: Path) -> None:
    write(path, 2, finish=False)
    with Recording.resume(path) as recording:
        assert recording.missing == [2, 3]
        for k in recording.missing:
            recording.append(make_line(k))
        recording.finish("finished", laser_off_verified=True)
    write(tmp_path / "whole.db")
    with Recording.open(path) as resumed, Recording.open(tmp_path / "whole.db") as whole:
        assert resumed.complete
        assert np.array_equal(resumed.cloud().points_mm, whole.cloud().points_mm, equal_nan=True)
        assert [event.kind for event in resumed.events()] == ["resumed"]


def test_resume_after_an_abort_forgets_the_old_end(path: Path) -> None:
    with Recording.create(path, HEADER) as recording:
        recording.append(make_line(0))
        recording.finish("aborted by the operator", laser_off_verified=True)
    with Recording.resume(path) as recording:
        assert recording.stop_reason is None
        assert recording.events()[-1].fields == {"stop_reason_before": "aborted by the operator"}


def test_resume_of_a_whole_scan_is_refused(path: Path) -> None:
    write(path)
    with pytest.raises(RecordingError, match="nothing to go on with"):
        Recording.resume(path)


@pytest.mark.parametrize(
    ("table", "column", "word"),
    [("line", "points", "points"), ("line", "sweeps", "points"), ("wave", "data", "traces")],
)
def test_a_damaged_line_is_told_skipped_and_scanned_again(path: Path, table: str, column: str, word: str) -> None:
    write(path)
    with sqlite3.connect(path) as raw:
        value = raw.execute(f"SELECT {column} FROM {table} WHERE k = 2").fetchone()[0]
        damaged = value + 1 if isinstance(value, int) else value[:50] + bytes([value[50] ^ 1]) + value[51:]
        raw.execute(f"UPDATE {table} SET {column} = ? WHERE k = 2", (damaged,))
    raw.close()
    with Recording.open(path) as recording:
        assert [check.index for check in recording.check() if not check.ok] == [2]
        with pytest.raises(RecordingError, match=f"line 2: the line is damaged: the check sum of the {word}"):
            list(recording.lines())
        assert [line.index for line in recording.lines(skip_damaged=True)] == [0, 1, 3]
    with Recording.resume(path) as recording:
        assert recording.missing == [2]
        assert recording.events()[0].kind == "line taken out"
        recording.append(make_line(2))
        assert all(check.ok for check in recording.check())


@pytest.mark.parametrize("damage", ["bit", "page", "end"])
def test_a_damaged_page_never_gives_wrong_points_nor_a_stack_trace(tmp_path: Path, damage: str) -> None:
    write(tmp_path / "good.db")
    good = (tmp_path / "good.db").read_bytes()
    rng = np.random.default_rng(4)
    told = 0
    for start in range(0, len(good), 4096):
        content = bytearray(good)
        if damage == "bit":
            content[start + int(rng.integers(4096))] ^= 1 << int(rng.integers(8))
        elif damage == "page":
            content[start : start + 4096] = rng.bytes(4096)
        else:
            del content[start:]
        path = tmp_path / "damaged.db"
        path.write_bytes(content)
        try:
            with Recording.open(path) as recording:
                told += not all(check.ok for check in recording.check())
                lines = list(recording.lines(skip_damaged=True))
                recording.events()
                assert recording.summary is not None
        except RecordingError:
            told += 1
            continue
        assert all(same(line, make_line(line.index)) for line in lines)
    assert told > 0


def test_a_line_twice_or_outside_the_raster_is_refused_and_the_rest_stays(path: Path) -> None:
    with Recording.create(path, HEADER) as recording:
        recording.append(make_line(0))
        with pytest.raises(RecordingError, match="line 0") as refused:
            recording.append(make_line(0))
        assert refused.value.kept == 1
        with pytest.raises(RecordingError, match="lines 0 to 3"):
            recording.append(make_line(4))
        with pytest.raises(RecordingError, match="response_mv has the shape"):
            recording.append(dataclasses.replace(make_line(1), response_mv=np.zeros(3)))
        recording.append(make_line(1))
        assert recording.done == [0, 1]


def test_create_refuses_what_it_must(path: Path, tmp_path: Path) -> None:
    write(path, 1)
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="exists already"):
        Recording.create(path, HEADER)
    assert path.read_bytes() == before
    with pytest.raises(RecordingError, match="there is no folder"):
        Recording.create(tmp_path / "nowhere" / "scan.db", HEADER)
    with pytest.raises(RecordingError, match="raster"):
        Recording.create(tmp_path / "a.db", {"seed": 1})
    with pytest.raises(RecordingError, match=r"raster\.rows"):
        Recording.create(tmp_path / "a.db", {"raster": {"rows": 0, "columns": 3}})
    with pytest.raises(RecordingError, match="`trace` needs start_ps"):
        Recording.create(tmp_path / "a.db", {**HEADER, "trace": {"start_ps": 0}})
    with pytest.raises(RecordingError, match="JSON"):
        Recording.create(tmp_path / "a.db", {**HEADER, "settings": object()})
    assert not (tmp_path / "a.db").exists()


def test_open_refuses_what_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such file"):
        Recording.open(tmp_path / "none.db")
    garbage = tmp_path / "garbage.db"
    garbage.write_bytes(b"this is certainly no database" * 100)
    with pytest.raises(RecordingError, match="no recording"):
        Recording.open(garbage)
    other = tmp_path / "other.db"
    with sqlite3.connect(other) as raw:
        raw.execute("CREATE TABLE scan (header TEXT)")
    raw.close()
    with pytest.raises(RecordingError, match="no recording"):
        Recording.open(other)
    (tmp_path / "empty.db").touch()
    with pytest.raises(RecordingError, match="no recording"):
        Recording.open(tmp_path / "empty.db")


def test_nothing_is_written_after_the_end(path: Path) -> None:
    with Recording.create(path, HEADER) as recording:
        recording.append(make_line(0))
        assert recording.finish("aborted", laser_off_verified=False)
        assert recording.cloud().rows.tolist() == [0] * 6
        with pytest.raises(RecordingError, match="the scan was closed"):
            recording.append(make_line(1))


def test_the_ten_lines_of_the_documentation_read_the_points(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (Path(__file__).parents[2] / "docs" / "recording.md").read_text(encoding="utf-8")
    example = text.split("nothing but its standard library:\n")[1].split("In MATLAB")[0]
    write(path.with_name("scan.db"))
    monkeypatch.chdir(path.parent)
    space: dict[str, sqlite3.Connection] = {}
    exec(textwrap.dedent(example), space)
    space["scan"].close()
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    with Recording.open("scan.db") as recording:
        cloud = recording.cloud().with_range()
    assert np.array_equal(np.array(rows, dtype=float)[:, 2:5], cloud.points_mm)
    assert np.array_equal(np.array(rows, dtype=float)[:, :2], cloud.grid)
    assert np.array_equal(np.array(rows, dtype=float)[:, 5], cloud.response_mv)


def test_the_lines_of_the_documentation_unpack_the_traces(path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "recording.md").read_text(encoding="utf-8")
    example = text.split("In Python:\n")[1].split("The k-th sample")[0]
    write(path, 1)
    with sqlite3.connect(path) as raw:
        row = raw.execute("SELECT rows, samples, bytes_per_sum, data FROM wave").fetchone()
    raw.close()
    names = ("rows", "samples", "bytes_per_sum", "data")
    space = {"numpy": np, "zstandard": zstandard, **dict(zip(names, row, strict=True))}
    exec(textwrap.dedent(example), space)
    assert np.array_equal(np.asarray(space["sums"]), make_line(0).sums)
