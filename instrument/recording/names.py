"""Before a scan: whether a recording can be made where it shall be, and what to do with a name that is taken."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

from picoradar.instrument.recording.database import create_database
from picoradar.instrument.recording.errors import RecordingError
from picoradar.instrument.recording.schema import APPLICATION_ID
from picoradar.instrument.recording.writer_lock import WriterLock

BESIDE = ("", "-wal", "-shm", "-journal")  # what SQLite keeps beside a database


def refuse_unwritable(folder: Path) -> None:
    """Make a recording with nothing in it, and take it away again: all that could refuse one does so now.

    Raises
    ------
    RecordingError
        If the folder cannot be written to, or its file system keeps no recording durable (network folders do not).
    """
    probe = folder / f".picoradar-probe-{os.getpid()}.db"
    try:
        create_database(probe, "{}").close()
    finally:
        remove_with_companions(probe)


def free_stillborn(path: Path) -> bool:
    """Take a recording away whose program was killed while it made the file: it holds no header, and so no line.

    Returns
    -------
    bool
        Whether there was one. Any other file is left alone.
    """
    if path.is_symlink() or not path.is_file():
        return False
    try:
        lock = WriterLock(path)
    except RecordingError:  # its writer lives
        return False
    try:
        stillborn = _is_stillborn(path)
        if stillborn:
            remove_with_companions(path)
    finally:
        lock.release()
    return stillborn


def _is_stillborn(path: Path) -> bool:
    if path.stat().st_size == 0 and not Path(f"{path}-wal").exists():
        return True
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True)) as database:
            application = database.execute("PRAGMA application_id").fetchone()[0]
            tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type='table'")}
            if application not in (0, APPLICATION_ID) or (tables and "scan" not in tables):
                return False
            if not tables:
                return True
            return application == APPLICATION_ID and not database.execute("SELECT count(*) FROM scan").fetchone()[0]
    except sqlite3.Error:
        return False


def remove_with_companions(path: Path) -> None:
    """Take a recording away, with what SQLite keeps beside it."""
    for ending in BESIDE:
        Path(f"{path}{ending}").unlink(missing_ok=True)
