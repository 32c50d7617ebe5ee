"""Acknowledged lines survive: kill -9, a power cut between any two pages, a disk that fails at any byte."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from picoradar.instrument.recording import Recording, RecordingError

resource = pytest.importorskip("resource", reason="limits of file sizes and kill -9 are POSIX")

PAGE = 4096
WRITER = Path(__file__).with_name("recording_writer.py")
FORM = {"start_ps": 6500.0, "step_ps": 6.7, "samples": 300, "zero_code": 40.0, "mv_per_code": 0.5}
HEADER = {"raster": {"rows": 500, "columns": 40}, "trace": FORM}


@pytest.fixture(scope="module")
def writer() -> ModuleType:
    spec = importlib.util.spec_from_file_location("recording_writer", WRITER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_kill_9_loses_no_acknowledged_line(tmp_path: Path, writer: ModuleType) -> None:
    """Five kills in a row on the same file; benchmarks/recording.py does two hundred."""
    path = tmp_path / "scan.db"
    waits = np.random.default_rng(11).uniform(0.0, 0.15, 5)
    acknowledged: set[int] = set()
    for wait in waits:
        process = subprocess.Popen([sys.executable, str(WRITER), str(path)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(wait)
        process.kill()
        rest = process.stdout.read()
        process.stdout.close()
        process.wait()
        acknowledged |= {int(word) for word in (first + rest).split(b"\n")[:-1]}
        with Recording.open(path) as recording:
            done = recording.done
            assert acknowledged <= set(done)
            assert done == list(range(len(done)))
            assert all(check.ok for check in recording.check())
            last = max(acknowledged)
            assert np.array_equal(recording.line(last).points_mm, writer.make_line(last).points_mm)
            assert recording.stop_reason is None
    assert len(acknowledged) > len(waits)


def copy(path: Path, folder: Path) -> Path:
    """Copy a recording that is being written, file by file, as a power cut would find it."""
    folder.mkdir()
    for name in (path.name, f"{path.name}-wal"):
        if (path.parent / name).exists():
            shutil.copyfile(path.parent / name, folder / name)
    return folder / path.name


def mixed(before: bytes, after: bytes, rng: np.random.Generator) -> bytes:
    """Return a file in which each page is at random the one before or after; the end is cut at random, too."""
    pages = -(-max(len(before), len(after)) // PAGE)
    chosen = [
        (after if new and len(after) > k * PAGE else before)[k * PAGE : (k + 1) * PAGE].ljust(PAGE, b"\0")
        for k, new in enumerate(rng.random(pages) < rng.random())
    ]
    size = int(rng.integers(len(before), max(len(before), len(after)) + 1))
    return b"".join(chosen)[:size]


def test_power_cut_during_a_line_keeps_the_lines_before(tmp_path: Path, writer: ModuleType) -> None:
    path = tmp_path / "scan.db"
    rng = np.random.default_rng(5)
    found_new = 0
    with Recording.create(path, HEADER) as recording:
        for index in range(4):
            before = copy(path, tmp_path / f"before{index}")
            recording.append(writer.make_line(index))
            after = copy(path, tmp_path / f"after{index}")
            assert before.read_bytes() == after.read_bytes()  # a line goes to the WAL alone
            old, new = (Path(f"{side}-wal").read_bytes() for side in (before, after))
            for case in range(18):
                cut = copy(before, tmp_path / f"cut{index}-{case}")
                Path(f"{cut}-wal").write_bytes(mixed(old, new, rng))
                with Recording.open(cut) as torn:
                    assert torn.done[:index] == list(range(index))
                    assert len(torn.done) <= index + 1
                    found_new += len(torn.done) == index + 1
                    assert all(check.ok for check in torn.check())
                with Recording.resume(cut) as torn:
                    torn.append(writer.make_line(torn.missing[0]))
    assert found_new < 40  # most cuts must have torn something, or the model tests nothing


def test_power_cut_while_the_wal_is_moved_into_the_file(tmp_path: Path, writer: ModuleType) -> None:
    path = tmp_path / "scan.db"
    rng = np.random.default_rng(6)
    with Recording.create(path, HEADER) as recording:
        for index in range(5):
            recording.append(writer.make_line(index))
        before = copy(path, tmp_path / "before")
        recording._connection.execute("PRAGMA wal_checkpoint(PASSIVE)")
        after = copy(path, tmp_path / "after")
    assert before.stat().st_size < after.stat().st_size
    for case in range(30):
        cut = copy(before, tmp_path / f"cut{case}")
        cut.write_bytes(mixed(before.read_bytes(), after.read_bytes(), rng))
        with Recording.open(cut) as torn:
            assert torn.done == [0, 1, 2, 3, 4]
            assert all(check.ok for check in torn.check())


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let every write beyond `size` bytes of a file fail (EFBIG), as a failing disk does."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_write_that_fails_at_any_byte_keeps_the_lines_before(tmp_path: Path, writer: ModuleType) -> None:
    whole = tmp_path / "whole.db"
    with Recording.create(whole, HEADER) as recording:
        recording.append(writer.make_line(0))
        start = Path(f"{whole}-wal").stat().st_size
        recording.append(writer.make_line(1))
        end = Path(f"{whole}-wal").stat().st_size
    for size in [start, start + 1, start + 24, *range(start + 100, end, 2777), end - 1]:
        path = tmp_path / f"limit{size}.db"
        with Recording.create(path, HEADER) as recording:
            recording.append(writer.make_line(0))
            with largest_file(size), pytest.raises(RecordingError, match="line 1: the disk reports") as failed:
                recording.append(writer.make_line(1))
            assert failed.value.kept == 1
            with pytest.raises(RecordingError, match="not open for writing any more"):
                recording.append(writer.make_line(2))
        with Recording.open(path) as recording:
            assert recording.done == [0]
            assert all(check.ok for check in recording.check())
        with Recording.resume(path) as recording:
            recording.append(writer.make_line(1))
            assert recording.done == [0, 1]


def test_a_checkpoint_that_fails_is_told_and_nothing_is_lost(
    tmp_path: Path, writer: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "scan.db"
    monkeypatch.setattr("picoradar.instrument.recording.database._LONGEST_WAL_BYTES", 0)
    with Recording.create(path, HEADER) as recording:
        for index in range(5):
            recording.append(writer.make_line(index))
        size = path.stat().st_size
        assert Path(f"{path}-wal").stat().st_size < size / 2  # each line was moved, so that the WAL begins anew
        with largest_file(size), pytest.raises(RecordingError, match="line 5: the disk reports") as failed:
            recording.append(writer.make_line(5))
        assert failed.value.kept == 6
    with Recording.open(path) as recording:
        assert recording.done == [0, 1, 2, 3, 4, 5]
        assert all(check.ok for check in recording.check())


def test_a_full_disk_keeps_the_lines_before_and_takes_more_when_there_is_room(
    tmp_path: Path, writer: ModuleType
) -> None:
    path = tmp_path / "scan.db"
    with Recording.create(path, HEADER) as recording:
        recording.append(writer.make_line(0))
        pages = recording._connection.execute("PRAGMA page_count").fetchone()[0]
        recording._connection.execute(f"PRAGMA max_page_count={pages + 2}")
        with pytest.raises(RecordingError, match="line 1: the disk is full") as failed:
            recording.append(writer.make_line(1))
        assert failed.value.kept == 1
        assert "picoradar resume" in str(failed.value)
        recording._connection.execute(f"PRAGMA max_page_count={pages + 100}")
        recording.append(writer.make_line(1))
        assert recording.done == [0, 1]
        recording.finish("the disk is full", laser_off_verified=True)
    with Recording.open(path) as recording:
        assert recording.stop_reason == "the disk is full"


def test_two_programs_cannot_write_at_the_same_time(tmp_path: Path, writer: ModuleType) -> None:
    path = tmp_path / "scan.db"
    with Recording.create(path, HEADER) as recording:
        recording.append(writer.make_line(0))
        with pytest.raises(RecordingError, match="another program is writing"):
            Recording.resume(path)
        recording.append(writer.make_line(1))
    with Recording.resume(path) as recording:
        assert recording.done == [0, 1]
    assert [entry.name for entry in tmp_path.iterdir()] == ["scan.db"]


@pytest.mark.slow
def test_a_disk_that_fails_at_any_of_its_write_calls(tmp_path: Path) -> None:
    """Every pwrite, fsync and ftruncate of a whole scan fails once, and from then on; see failing_disk.py."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        pytest.skip(reason="needs a C compiler and LD_PRELOAD")
    here = Path(__file__).parent
    shim = tmp_path / "failing_disk.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", shim, here / "failing_disk.c", "-ldl"], check=True)
    memory = Path("/dev/shm")  # what a call returns is tested here, not how long a disk takes for it
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else tmp_path) as folder:
        done = subprocess.run(
            [sys.executable, here / "failing_disk.py", folder],
            env={**os.environ, "LD_PRELOAD": str(shim)},
            capture_output=True,
            check=True,
        )
    for outcome in json.loads(done.stdout):
        assert outcome["runs"] > 40, outcome
        assert outcome["failed"] >= 0.8 * outcome["runs"], outcome
        wrong = ("lost_lines", "damaged_lines", "unreadable", "false_ends", "not_resumed")
        assert {name: outcome[name] for name in wrong} == dict.fromkeys(wrong, 0), done.stderr.decode()
