"""The last of two echoes in recordings: kept to the bit, under a check sum, beside files that know nothing of it."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.line import LAST_ECHO, Flag, ScanLine
from picoradar.instrument.recording import Recording, RecordingError, salvage
from picoradar.instrument.recording.layout import line_crc32

ROWS, COLUMNS = 4, 6
HEADER = {
    "raster": {"rows": ROWS, "columns": COLUMNS, "step_mm": 1.0, "mode": "sweep", "averages": 8},
    "trace": {"start_ps": 6500.0, "step_ps": 6.7, "samples": 9, "zero_code": 40.0, "mv_per_code": 0.5},
}


def with_one_echo(index: int, columns: int = COLUMNS) -> ScanLine:
    rng = np.random.default_rng(index)
    points = rng.normal(size=(columns, 3)) + [0, 0, 900]
    return ScanLine(
        index=index,
        columns=np.arange(columns, dtype=np.int32),
        angles_rad=rng.normal(size=(columns, 2)),
        points_mm=points,
        covariance_mm2=np.tile(np.eye(3), (columns, 1, 1)),
        range_mm=points[:, 2],
        range_variance_mm2=rng.uniform(0.05, 0.1, columns),
        response_mv=rng.uniform(20, 60, columns),
        flags=np.zeros(columns, dtype=np.uint16),
        traces=Trace(rng.integers(0, 500, (columns, 9)).astype(np.uint16), 8, np.arange(9.0), CodeScale(40.0, 0.5)),
        sweeps=8,
        device_time_s=0.5 + index,
    )


def with_two_echoes(index: int) -> ScanLine:
    """Give a line whose second and fifth place have a last echo."""
    line, rng = with_one_echo(index), np.random.default_rng(100 + index)
    flags = line.flags.copy()
    flags[[1, 4]] = Flag.MIXED
    last = {}
    for name, shape in LAST_ECHO.items():
        last[name] = np.full((COLUMNS, *shape), np.nan)
        last[name][[1, 4]] = rng.normal(size=(2, *shape))
    return replace(line, flags=flags, **last)


def same(one: Any, other: Any) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True) for name in LAST_ECHO)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "scan.db"
    with Recording.create(file, HEADER) as recording:
        for index in (0, 1, 2):
            recording.append(with_two_echoes(index) if index % 2 == 0 else with_one_echo(index))
    return file


def change(path: Path, statement: str, *values: object) -> None:
    with sqlite3.connect(path) as raw:
        raw.execute(statement, values)
    raw.close()


def test_where_nothing_is_said_there_is_one_echo() -> None:
    for columns in (COLUMNS, 0):
        line = with_one_echo(0, columns)
        assert {name: getattr(line, name).shape for name in LAST_ECHO} == {
            name: (columns, *shape) for name, shape in LAST_ECHO.items()
        }
        assert not line.two_echoes.any()


def test_both_echoes_come_back_from_line_and_cloud(path: Path) -> None:
    with Recording.open(path) as recording:
        for index in range(3):
            expected = with_two_echoes(index) if index % 2 == 0 else with_one_echo(index)
            assert same(recording.line(index), expected)
            assert same(recording.line(index, traces=False), expected)
        cloud = recording.cloud()
    assert np.flatnonzero(cloud.two_echoes).tolist() == [1, 4, 13, 16]
    assert np.array_equal(cloud.where(cloud.two_echoes).last_range_mm[2:], with_two_echoes(2).last_range_mm[[1, 4]])


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_last_echoes_come_back(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    columns = data.draw(st.integers(0, 7))
    last = {
        name: data.draw(arrays(np.float64, (columns, *shape), elements=numbers)) for name, shape in LAST_ECHO.items()
    }
    line = replace(with_one_echo(0, columns), **last)
    with Recording.create(tmp_path_factory.mktemp("any") / "scan.db", HEADER) as recording:
        recording.append(line)
        assert same(recording.line(0), line)


@pytest.mark.parametrize("name", list(LAST_ECHO))
def test_arrays_that_do_not_fit_are_refused(path: Path, name: str) -> None:
    line = replace(with_two_echoes(3), **{name: np.zeros(COLUMNS + 1)})
    with Recording.resume(path) as recording:
        with pytest.raises(RecordingError, match=f"{name} has the shape"):
            recording.append(line)
        assert recording.done == [0, 1, 2]


def test_a_scan_without_two_echoes_has_the_bytes_and_check_sums_that_it_had(path: Path) -> None:
    with sqlite3.connect(path) as raw:
        row = raw.execute("SELECT n, sweeps, device_time_s, points, crc32 FROM line WHERE k = 1").fetchone()
        assert [k for (k,) in raw.execute("SELECT k FROM echo ORDER BY k")] == [0, 2]
    raw.close()
    count, sweeps, begun, points, crc = row
    assert (len(points), crc) == (142 * COLUMNS, line_crc32(1, count, sweeps, begun, points))


def as_layout_3(path: Path) -> None:
    """Turn a recording into what the layout before was: without the table of last echoes."""
    with sqlite3.connect(path) as raw:
        raw.executescript("PRAGMA foreign_keys=ON; DELETE FROM line WHERE k <> 1; DROP TABLE echo;")
        raw.execute("PRAGMA user_version=3")
    raw.close()


def test_a_recording_of_the_layout_before_still_opens_and_goes_on(path: Path) -> None:
    as_layout_3(path)
    with Recording.open(path) as old:
        assert all(check.ok for check in old.check())
        assert same(old.line(1), with_one_echo(1))
        assert not old.cloud().two_echoes.any()
    with sqlite3.connect(path) as raw:
        assert raw.execute("PRAGMA user_version").fetchone() == (3,)  # reading has changed nothing
    raw.close()
    with Recording.resume(path) as going_on:
        assert going_on.missing == [0, 2, 3]
        for index in going_on.missing:
            going_on.append(with_two_echoes(index))
        going_on.finish("complete", laser_off_verified=True)
    with Recording.open(path) as whole:
        assert whole.complete
        assert same(whole.line(1), with_one_echo(1))
        assert all(same(whole.line(index), with_two_echoes(index)) for index in (0, 2, 3))


def test_a_recording_of_the_layout_before_is_salvaged(path: Path) -> None:
    as_layout_3(path)
    new, kept, _ = salvage(path)
    assert kept == [1]
    with Recording.open(new) as found:
        assert same(found.line(1), with_one_echo(1))


DAMAGE: dict[str, Callable[[Path], None]] = {
    "lost": lambda path: change(path, "DELETE FROM echo WHERE k = 2"),
    "of another line": lambda path: change(path, "UPDATE echo SET data = (SELECT data FROM echo WHERE k = 0)"),
    "a bit": lambda path: change(path, "UPDATE echo SET data = ? WHERE k = 2", flipped(path)),
    "one more": lambda path: change(path, "UPDATE echo SET n = 3 WHERE k = 2"),
    "no bytes": lambda path: change(path, "UPDATE echo SET data = 'text' WHERE k = 2"),
}


def flipped(path: Path) -> bytes:
    with sqlite3.connect(path) as raw:
        data = bytearray(raw.execute("SELECT data FROM echo WHERE k = 2").fetchone()[0])
    raw.close()
    data[40] ^= 1
    return bytes(data)


@pytest.mark.parametrize("kind", list(DAMAGE))
def test_a_damaged_last_echo_is_a_damaged_line(path: Path, kind: str) -> None:
    DAMAGE[kind](path)
    with Recording.open(path) as recording:
        assert [check.index for check in recording.check() if not check.ok] == [2]
        with pytest.raises(RecordingError, match="the line is damaged"):
            recording.line(2, traces=False)
        assert same(recording.line(0), with_two_echoes(0))
    with Recording.resume(path) as going_on:  # scanned again, with echoes of its own
        assert going_on.missing == [2, 3]
        going_on.append(with_two_echoes(2))
        assert same(going_on.line(2), with_two_echoes(2))


def test_what_is_salvaged_has_its_last_echoes(path: Path) -> None:
    change(path, "DELETE FROM echo WHERE k = 0")
    new, kept, lost = salvage(path)
    assert (kept, lost) == ([1, 2], [0, 3])
    with Recording.open(new) as found:
        assert same(found.line(2), with_two_echoes(2))


@pytest.mark.parametrize("places", [(-1, 3), (0, COLUMNS), (3, 3), (4, 1)])
def test_last_echoes_of_no_place_are_refused_whatever_their_check_sum(path: Path, places: tuple[int, int]) -> None:
    with sqlite3.connect(path) as raw:
        data = raw.execute("SELECT data FROM echo WHERE k = 2").fetchone()[0]
        entries = [place.to_bytes(4, "little", signed=True) for place in places]
        data = entries[0] + data[4:60] + entries[1] + data[64:]
        count, sweeps, begun, points = raw.execute(
            "SELECT n, sweeps, device_time_s, points FROM line WHERE k=2"
        ).fetchone()
    raw.close()
    change(path, "UPDATE echo SET data = ? WHERE k = 2", data)
    change(path, "UPDATE line SET crc32 = ? WHERE k = 2", line_crc32(2, count, sweeps, begun, points, data))
    with Recording.open(path) as recording, pytest.raises(RecordingError, match="of other places than its 6"):
        recording.line(2)


def test_the_lines_of_the_documentation_read_the_last_echoes(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (Path(__file__).parents[2] / "docs" / "recording.md").read_text(encoding="utf-8")
    example = text.split("The last echoes, in Python:\n\n")[1].split("\n\n")[0]
    monkeypatch.chdir(path.parent)
    space: dict[str, Any] = {}
    exec("\n".join(line.removeprefix("    ") for line in example.splitlines()), space)
    space["scan"].close()
    found = np.array([line.split() for line in capsys.readouterr().out.splitlines()], dtype=float)
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    two = cloud.where(cloud.two_echoes)
    assert np.array_equal(found, np.column_stack([two.rows, two.columns, two.range_mm, two.last_range_mm]))
