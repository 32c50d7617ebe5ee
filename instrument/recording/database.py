"""The SQLite file under a recording: how it is made and opened, and the settings that make a line durable.

Measured in docs/recording.md. WAL with ``synchronous=FULL`` survives kill -9 and a power cut; ``NORMAL`` loses lines.
SQLite 3.7.0 to 3.51.2 may corrupt a WAL when two connections write or checkpoint at the same time ("WAL-reset"), so
one connection writes, it alone checkpoints, at times of its own choosing, and readers are opened read-only.
"""

from __future__ import annotations

import os
import sqlite3
import sys
import zlib
from pathlib import Path

from picoradar.instrument.recording.errors import READING_ERRORS, RecordingError, from_sqlite, primary_code
from picoradar.instrument.recording.schema import APPLICATION_ID, LATER_TABLES, LAYOUT, SCHEMA

_BUSY_S = 2.0
_LONGEST_WAL_BYTES = 16_000_000


def create_database(path: Path, header: str) -> sqlite3.Connection:
    """Make a new file (mode 0600: a scan is a patient's) with its tables and header; return the writing connection.

    Raises
    ------
    RecordingError
        If the file exists or the folder cannot be written to. No half-made file is left.
    """
    if not path.parent.is_dir():
        raise RecordingError(path, f"there is no folder {path.parent}", "make it first")
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600))
    except FileExistsError:
        raise RecordingError(
            path, "the file exists already", "recordings are never overwritten; name another"
        ) from None
    except OSError as error:
        raise RecordingError(
            path, f"cannot be made ({error.strerror})", "check the folder and its permissions"
        ) from error
    try:
        connection = _connect(path, "rw")
        connection.execute(f"PRAGMA application_id={APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version={LAYOUT}")
        make_durable(connection)
        connection.executescript(SCHEMA)
        row = (header, zlib.crc32(header.encode()))
        connection.execute("INSERT INTO scan (id, header, header_crc32) VALUES (1, ?, ?)", row)
        # The row in `scan` is written anew at the end, behind all lines; this one stays where a cut file still has it.
        connection.execute("INSERT INTO spare_header VALUES (1, ?, ?)", row)
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")  # header and tables are in the file itself from now on
        sync_folder(path.parent)
    except (sqlite3.Error, OSError) as error:
        for leftover in (path, Path(f"{path}-wal"), Path(f"{path}-shm")):
            leftover.unlink(missing_ok=True)
        if isinstance(error, sqlite3.Error):
            raise from_sqlite(path, error) from error
        raise RecordingError(path, f"cannot be made ({error.strerror})") from error
    return connection


def open_database(path: Path, *, writing: bool) -> sqlite3.Connection:
    """Open an existing recording.

    Raises
    ------
    RecordingError
        If there is no such file, it is no recording, has a later layout, or cannot be opened.
    """
    refuse_missing(path)
    try:
        connection, application, layout = _open_known(path, "rw" if writing else "ro")
    except READING_ERRORS as error:
        if getattr(error, "sqlite_errorcode", 0) != sqlite3.SQLITE_READONLY_ROLLBACK:
            raise _not_opened(path, error) from error
        connection, application, layout = _open_after_recovery(path)
    if application != APPLICATION_ID or layout > LAYOUT:
        connection.close()
        if application != APPLICATION_ID:
            raise RecordingError(path, "this is no recording", "give a file that `picoradar scan` has written")
        raise RecordingError(path, f"has layout {layout}; this picoradar reads up to {LAYOUT}", "use a newer picoradar")
    if writing:
        try:
            make_durable(connection)
            if layout < LAYOUT:
                _renew(connection, layout)
        except sqlite3.Error as error:
            connection.close()
            raise from_sqlite(path, error) from error
    return connection


def refuse_missing(path: Path) -> None:
    """Refuse the path of no file, also one that the system does not take (a name that is too long).

    Raises
    ------
    RecordingError
    """
    why = ""
    try:
        there = path.is_file()
    except OSError as error:
        there, why = False, f" ({error.strerror})"
    if not there:
        raise RecordingError(path, f"there is no such file{why}", "give the path of a recording")


def _renew(connection: sqlite3.Connection, layout: int) -> None:
    """Give a recording of an earlier layout the tables that it lacks, so that it can be gone on with."""
    missing = LATER_TABLES.get(layout, "")
    connection.executescript(f"BEGIN IMMEDIATE; {missing} PRAGMA user_version={LAYOUT}; COMMIT;")


def _open_known(path: Path, mode: str) -> tuple[sqlite3.Connection, int, int]:
    connection = _connect(path, mode)
    application = connection.execute("PRAGMA application_id").fetchone()[0]
    return connection, application, connection.execute("PRAGMA user_version").fetchone()[0]


def _open_after_recovery(path: Path) -> tuple[sqlite3.Connection, int, int]:
    """Open for reading what was broken off in the last step of `to_one_file`; only a writer may undo that step."""
    try:
        _open_known(path, "rw")[0].close()
        return _open_known(path, "ro")
    except READING_ERRORS as error:
        raise _not_opened(path, error) from error


def _not_opened(path: Path, error: Exception) -> RecordingError:
    """A scan that was never closed can only be read where SQLite may write beside it."""
    closed_off = primary_code(error) in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY)
    if closed_off and not os.access(path.parent, os.W_OK):
        remedy = f"copy it, together with {path.name}-wal, to a folder that you may write to"
        return RecordingError(path, "the scan was never closed, and its folder is read-only", remedy)
    return from_sqlite(path, error)


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    address = f"{path.resolve().as_uri()}?mode={mode}"
    # Reads and writes may come from several threads; `Recording` lets one in at a time.
    connection = sqlite3.connect(address, uri=True, timeout=_BUSY_S, isolation_level=None, check_same_thread=False)
    if mode == "ro":
        connection.execute("PRAGMA query_only=ON")
    return connection


def make_durable(connection: sqlite3.Connection) -> None:
    """Set what makes a committed transaction survive a power cut, and check that SQLite took it.

    Raises
    ------
    sqlite3.OperationalError
        If the file system does not allow a WAL (network folders do not).
    """
    mode = connection.execute("PRAGMA journal_mode=WAL").fetchone()[0]
    if mode != "wal":
        raise sqlite3.OperationalError(f"journal_mode is {mode}, not wal: use a folder on a local disk")
    connection.execute("PRAGMA synchronous=FULL")
    connection.execute("PRAGMA foreign_keys=ON")
    # SQLite's own automatic checkpoint hides its errors; `Recording` checkpoints by itself and checks them.
    connection.execute("PRAGMA wal_autocheckpoint=0")
    if sys.platform == "darwin":  # plain fsync does not reach the platter there
        connection.execute("PRAGMA fullfsync=1")
        connection.execute("PRAGMA checkpoint_fullfsync=1")


def checkpoint_if_long(connection: sqlite3.Connection, path: Path) -> None:
    """Move what is in the WAL into the file before it gets long.

    Raises
    ------
    sqlite3.Error
        If the disk fails. Nothing is lost then: the WAL stays as it is.
    """
    wal = Path(f"{path}-wal")
    if wal.exists() and wal.stat().st_size > _LONGEST_WAL_BYTES:
        connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()


def to_one_file(connection: sqlite3.Connection, path: Path) -> bool:
    """Bring everything into the one file; return False, with all still safe, while somebody reads.

    Raises
    ------
    sqlite3.Error, OSError
        If the disk fails.
    """
    try:
        if connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()[0]:
            return False
        connection.execute("PRAGMA journal_mode=DELETE")
    except sqlite3.OperationalError as error:
        if primary_code(error) == sqlite3.SQLITE_BUSY:
            return False
        raise
    sync_folder(path.parent)
    return True


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable (on Windows folders cannot be synced, and need not be).

    Raises
    ------
    OSError
        If the disk fails.
    """
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
