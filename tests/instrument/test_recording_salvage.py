"""A recording that was cut short gives what still reads; a name that a killed program has left can be used again."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.recording import Recording, RecordingError, free_stillborn, refuse_unwritable, salvage


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "scan.db"
    assert run(["scan", "--grid", "12x10", "--seed", "3", "-o", str(path)]) == 0
    return path.read_bytes()


@pytest.mark.parametrize(("share", "at_least"), [(0.7, 5), (0.8, 7), (0.95, 12)])
def test_a_cut_recording_is_salvaged_as_far_as_it_reads(
    share: float, at_least: int, whole: bytes, tmp_path: Path
) -> None:
    """The lines take about the half of this file in the middle; raw samples may be lost where the line is not."""
    cut, sound = tmp_path / "cut.db", tmp_path / "sound.db"
    sound.write_bytes(whole)
    cut.write_bytes(whole[: int(len(whole) * share)])
    before = cut.read_bytes()
    with pytest.raises(RecordingError, match="--salvage"), Recording.open(cut) as recording:
        recording.check()
    new, lines, lost = salvage(cut)
    assert cut.read_bytes() == before
    assert (new.name, sorted(lines + lost)) == ("cut-salvaged.db", list(range(12)))
    assert (lines, lost) == (sorted(lines), sorted(lost))
    assert len(lines) >= at_least
    with Recording.open(sound) as expected, Recording.open(new) as found:
        assert all(check.ok for check in found.check())
        for index in lines:
            assert np.array_equal(found.line(index).range_mm, expected.line(index).range_mm)
        assert sum(found.line(index).traces is not None for index in lines) >= at_least - 2
    if lost:
        assert run(["resume", str(new)]) == 0
        with Recording.open(new) as found:
            assert found.complete
    with pytest.raises(RecordingError, match="exists already"):
        salvage(cut)


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0", b"SQLite format 3\0" + bytes(9000), b"no recording"])
def test_where_nothing_reads_nothing_is_made(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "cut.db"
    path.write_bytes(content)
    with pytest.raises(RecordingError):
        salvage(path)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cut.db"]


@pytest.mark.parametrize("statements", [0, 1, 2, 5, 7])
def test_the_name_of_a_recording_that_was_never_born_is_free_again(statements: int, tmp_path: Path) -> None:
    """The program is killed inside the creation, after some of its statements."""
    path = tmp_path / "scan.db"
    program = f"""
import os, sqlite3
from picoradar.instrument.recording import database
class Dying(sqlite3.Connection):
    left = {statements}
    def _count(self):
        if not Dying.left: os._exit(9)
        Dying.left -= 1
    def execute(self, *a): self._count(); return super().execute(*a)
    def executescript(self, *a): self._count(); return super().executescript(*a)
connect = sqlite3.connect
sqlite3.connect = lambda *a, **k: connect(*a, **k, factory=Dying)
from picoradar.instrument.recording import Recording
Recording.create({str(path)!r}, {{"raster": {{"rows": 2, "columns": 2}}}})
"""
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=60).returncode == 9
    assert path.exists()
    assert run(["scan", "--grid", "2x2", "-o", str(path)]) == 0


def test_no_other_file_is_taken_for_one(tmp_path: Path) -> None:
    text, foreign, link = tmp_path / "a.db", tmp_path / "b.db", tmp_path / "c.db"
    text.write_text("a diary")
    with sqlite3.connect(foreign) as database:
        database.execute("CREATE TABLE diary (day TEXT)")
    link.symlink_to(tmp_path / "nothing")
    recording = tmp_path / "d.db"
    with Recording.create(recording, {"raster": {"rows": 2, "columns": 2}}):
        assert not free_stillborn(recording)
    for path in (text, foreign, link, recording, tmp_path):
        assert not free_stillborn(path)
        assert path.is_symlink() or path.exists()


def test_a_folder_that_cannot_be_written_to_is_refused_before_anything_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(path: Path, *_: object) -> int:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(RecordingError, match="Permission denied"):
        refuse_unwritable(tmp_path)
    monkeypatch.setattr("picoradar.instrument.cli.simulated.Simulated.__init__", refuse)
    assert run(["scan", "--grid", "2x2", "-o", str(tmp_path / "scan.db")]) == 2
    assert "Permission denied" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
@pytest.mark.parametrize("room", [0.5, 1.1])
def test_a_disk_without_room_is_told_and_not_taken_for_damage(room: float, whole: bytes, tmp_path: Path) -> None:
    """No room for the copy that is read, and none for the new recording."""
    path = tmp_path / "scan.db"
    path.write_bytes(whole)
    limited = (
        "import resource, sys; from pathlib import Path; from picoradar.instrument.recording import salvage;"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({int(room * len(whole))},) * 2); salvage(Path(sys.argv[1]))"
    )
    done = subprocess.run([sys.executable, "-c", limited, str(path)], capture_output=True, text=True, check=False)
    assert "RecordingError" in done.stderr.splitlines()[-1], done.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["scan.db"]
