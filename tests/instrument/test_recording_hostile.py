"""Recordings made to harm: right check sums, wrong content. Each is refused in words, and nothing large is unpacked."""

from __future__ import annotations

import json
import shutil
import sqlite3
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard

from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording, RecordingError
from picoradar.instrument.recording.layout import Wave, compressed, decode_wave, decompressed, line_crc32
from picoradar.instrument.recording.limits import LARGEST_LINE_BYTES
from picoradar.instrument.recording.salvage import salvage
from tests.memory import peak_bytes

HEADER = {
    "raster": {"rows": 3, "columns": 2, "step_mm": 1.0, "mode": "sweep", "averages": 8},
    "trace": {"start_ps": 6500.0, "step_ps": 6.7, "samples": 4, "zero_code": 8192, "mv_per_code": 0.5},
    "settings": {},
}
BOMB_BYTES = 60_000_000
A_FEW_BYTES = 10_000_000


@pytest.fixture
def file(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(sound, tmp_path))


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sound") / "scan.db"
    count = 2
    with Recording.create(path, HEADER) as recording:
        recording.append(
            ScanLine(
                index=0,
                columns=np.arange(count, dtype=np.int32),
                angles_rad=np.zeros((count, 2)),
                points_mm=np.zeros((count, 3)),
                covariance_mm2=np.zeros((count, 3, 3)),
                range_mm=np.zeros(count),
                range_variance_mm2=np.zeros(count),
                response_mv=np.zeros(count),
                flags=np.zeros(count, dtype=np.uint16),
                traces=None,
                sweeps=8,
                device_time_s=0.5,
            )
        )
        recording.event(1.0, "note", words="all well")
    return path


def change(path: Path, *statements: tuple[str, tuple[object, ...]]) -> None:
    database = sqlite3.connect(path)
    with database:
        for statement, values in statements:
            database.execute(statement, values)
    database.close()


def with_header(path: Path, text: str | None) -> None:
    crc = 0 if text is None else zlib.crc32(text.encode())
    change(
        path,
        ("PRAGMA writable_schema=1", ()),
        ("UPDATE sqlite_schema SET sql=replace(sql, 'header TEXT NOT NULL', 'header TEXT')", ()),
    )
    change(path, ("UPDATE scan SET header=?, header_crc32=?", (text, crc)))


def replaced(**changes: object) -> str:
    return json.dumps({**HEADER, **changes})


def raster(**changes: object) -> str:
    return replaced(raster={**HEADER["raster"], **changes})


def trace(**changes: object) -> str:
    return replaced(trace={**HEADER["trace"], **changes})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "check sum of the header"),
        ("[" * 200_000, "nested too deeply"),
        ("[]", "the header is damaged"),
        ('{"seed": ' + "9" * 5000 + "}", "4300 digits"),
        (replaced(raster=None), "no `raster`"),
        (replaced(raster="40x40"), "no `raster`"),
        (replaced(raster=[3, 2]), "no `raster`"),
        (raster(rows=10**10), "raster.rows of the header is 10000000000"),
        (raster(rows=0), "raster.rows of the header is 0"),
        (raster(rows="3"), "raster.rows of the header is '3'"),
        (raster(columns=10**9), "raster.columns"),
        (raster(columns=2.0), "raster.columns"),
        (raster(step_mm="1"), "raster.step_mm"),
        (raster(plan=["raster"]), "raster.plan"),
        (trace(samples=10**12), "trace.samples"),
        (trace(samples=-1), "trace.samples"),
        (trace(zero_code=None), "trace.zero_code"),
        (trace(start_ps="now"), "trace.start_ps"),
        (trace(step_ps=float("inf")), "trace.step_ps"),
        (replaced(trace={"samples": 4}), "`trace` needs"),
        (replaced(trace="all"), "`trace` is no JSON object"),
        (replaced(settings="none"), "`settings` is no JSON object"),
        (replaced(calibration=[]), "`calibration` is no JSON object"),
        (replaced(scanner=["dg645"]), "`scanner` is no JSON object"),
    ],
)
def test_a_header_that_was_never_written(file: Path, text: str | None, words: str) -> None:
    with_header(file, text)
    with pytest.raises(RecordingError, match=words):
        Recording.open(file)


@pytest.mark.parametrize("name", ["raster", "trace"])
@pytest.mark.parametrize(
    "changes", [{"rows": 10**10}, {"columns": 10**9}, {"step_mm": "1"}, {"samples": 10**12}, {"mv_per_code": "1"}]
)
def test_what_is_not_read_is_not_written(tmp_path: Path, name: str, changes: dict[str, object]) -> None:
    if not set(changes) & set(HEADER[name]):
        return
    with pytest.raises(RecordingError, match=f"{name}.{next(iter(changes))}"):
        Recording.create(tmp_path / "new.db", {**HEADER, name: {**HEADER[name], **changes}})


LINE = "UPDATE line SET {}=?"


@pytest.mark.parametrize(
    ("statement", "value", "words"),
    [
        (LINE.format("n"), "abc", "required argument is not an integer"),
        (LINE.format("n"), 2**62, "check sum"),
        (LINE.format("points"), "text", "bytes-like"),
        (LINE.format("device_time_s"), b"\x00", "not a float"),
        (LINE.format("sweeps"), 2.5, "not an integer"),
        (LINE.format("crc32"), "none", "check sum"),
        (LINE.format("k"), 7, "the raster has the lines 0 to 2"),
        (LINE.format("k"), -1, "the raster has the lines 0 to 2"),
        (LINE.format("k"), 2**62, "the raster has the lines 0 to 2"),
    ],
)
def test_a_line_of_other_types(file: Path, statement: str, value: object, words: str) -> None:
    change(file, (statement, (value,)))
    with Recording.open(file) as recording:
        (line,) = recording.check()
        assert words in line.problem
        with pytest.raises(RecordingError):
            recording.cloud()
        assert len(recording.cloud(skip_damaged=True)) == 0


def opened(path: Path, use: Callable[[Recording], Any]) -> Any:
    with Recording.open(path) as recording:
        return use(recording)


@pytest.mark.parametrize(
    ("statement", "value", "use", "words"),
    [
        ("UPDATE event SET data=?", b"{}", lambda r: r.events(), "an event is no text"),
        ("UPDATE event SET data=?", "[" * 200_000, lambda r: r.events(), "an event is damaged"),
        ("UPDATE event SET data=?", "[]", lambda r: r.events(), "an event is damaged"),
        ("UPDATE event SET t=?", "noon", lambda r: r.events(), "an event is damaged"),
        ("UPDATE event SET kind=?", b"\x00", lambda r: r.events(), "an event is damaged"),
        ("UPDATE scan SET summary=?", 5.5, lambda r: r.summary, "the summary"),
        ("UPDATE scan SET summary=?", b"{}", lambda r: r.summary, "the summary is no text"),
        ("UPDATE scan SET stop_reason=?", b"\xff", lambda r: r.stop_reason, "reason of its end"),
    ],
)
def test_events_and_end_of_other_types(
    file: Path, statement: str, value: object, use: Callable[[Recording], Any], words: str
) -> None:
    change(file, (statement, (value,)))
    with pytest.raises(RecordingError, match=words):
        opened(file, use)


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE VIEW more AS SELECT 1",
        "CREATE TRIGGER more AFTER UPDATE ON scan BEGIN DELETE FROM line; END",
        "CREATE TABLE more (k)",
        "CREATE INDEX more ON line (n)",
    ],
)
def test_more_than_the_tables_of_a_recording(file: Path, statement: str) -> None:
    change(file, (statement, ()))
    with pytest.raises(RecordingError, match="has 'more', which no recording has"):
        Recording.open(file)


def test_a_view_that_never_ends_in_place_of_the_lines(file: Path) -> None:
    endless = "WITH RECURSIVE c(k) AS (SELECT 0 UNION ALL SELECT k + 1 FROM c) SELECT k FROM c"
    change(file, ("DROP TABLE line", ()), (f"CREATE VIEW line AS {endless}", ()))
    with pytest.raises(RecordingError, match="has 'line', which no recording has"):
        Recording.open(file)
    with pytest.raises(RecordingError, match="has 'line', which no recording has"):
        salvage(file)
    assert not list(file.parent.glob("*salvaged*"))


def test_a_schema_whose_bytes_are_no_text(file: Path) -> None:
    """SQLite quotes them in its message, which Python then cannot decode."""
    content = file.read_bytes()
    assert b"TABLE line (" in content
    file.write_bytes(content.replace(b"TABLE line (", b"TABLE \xffine ("))
    for use in (Recording.open, salvage):
        with pytest.raises(RecordingError, match="the file is damaged"):
            use(file)


@pytest.fixture(scope="module")
def bomb() -> bytes:
    frame = zstandard.ZstdCompressor(write_content_size=True).compress(bytes(BOMB_BYTES))
    assert len(frame) < 20_000
    return frame


@pytest.mark.parametrize("claimed", [4, LARGEST_LINE_BYTES + 1])
def test_a_bomb_is_not_unpacked(bomb: bytes, claimed: int) -> None:
    """Python's zstandard goes by the size that the frame names, whatever ``max_output_size`` says."""

    def refused() -> None:
        with pytest.raises(ValueError, match=f"instead of 4|claim {LARGEST_LINE_BYTES + 1} bytes"):
            decompressed(bomb, claimed)

    assert peak_bytes(refused) < A_FEW_BYTES


def test_a_bomb_without_its_size_is_not_unpacked() -> None:
    frame = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(BOMB_BYTES))

    def refused() -> None:
        with pytest.raises(ValueError, match=r"cannot be decompressed|instead of"):
            decompressed(frame, 1000)

    assert peak_bytes(refused) < A_FEW_BYTES


@pytest.mark.parametrize("size", [0, 1, 1000])
def test_what_was_compressed_comes_back(size: int) -> None:
    assert decompressed(compressed(bytes(size)), size) == bytes(size)


@pytest.mark.parametrize(
    ("rows", "samples", "width"), [(-1, 4, 2), (2, -4, -2), (10**10, 10**10, 8), (2, 4, 3), (1, 8, 0)]
)
def test_a_wave_with_a_form_that_cannot_be(rows: int, samples: int, width: int) -> None:
    data = compressed(bytes(16))
    crc = zlib.crc32(data, zlib.crc32(np.array([0, rows, samples, width], "<i8").tobytes()))
    with pytest.raises((ValueError, TypeError)):
        decode_wave(0, Wave(rows, samples, width, crc, data))


def test_a_line_too_large_is_not_written() -> None:
    with pytest.raises(ValueError, match=f"at most {LARGEST_LINE_BYTES}"):
        compressed(bytes(LARGEST_LINE_BYTES + 1))


def test_the_helper_makes_lines_that_are_read(file: Path) -> None:
    """The right check sum is not what refuses the files above."""
    with Recording.open(file) as recording:
        blob = recording._connection.execute("SELECT points FROM line").fetchone()[0]
    change(file, ("UPDATE line SET sweeps=9, crc32=?", (line_crc32(0, 2, 9, 0.5, blob),)))
    with_header(file, json.dumps(HEADER))
    with Recording.open(file) as recording:
        assert recording.line(0).sweeps == 9
        assert recording.missing == [1, 2]
