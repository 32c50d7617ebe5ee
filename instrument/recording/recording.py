"""`Recording`: one SQLite file a scan, written line by line; an acknowledged line survives kill -9 and a power cut."""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path
from typing import Self

from picoradar.instrument.events import JsonObject
from picoradar.instrument.recording import registration_rows
from picoradar.instrument.recording.database import create_database, open_database, refuse_missing, to_one_file
from picoradar.instrument.recording.errors import RecordingError, from_sqlite
from picoradar.instrument.recording.header import canonical, complete_header
from picoradar.instrument.recording.writer import Writer
from picoradar.instrument.recording.writer_lock import WriterLock


class Recording(Writer):
    """A scan on the disk.

    Make one with `create` (new scan), `resume` (go on with an interrupted one) or `open` (read only; also while it is
    being written). A context manager: leaving it closes the file, and does not declare the scan finished.
    """

    @classmethod
    def create(cls, path: str | os.PathLike[str], header: JsonObject) -> Self:
        """Begin a recording.

        Parameters
        ----------
        path : path
            A file that does not exist, on a local disk.
        header : mapping
            JSON content. Needed: ``raster`` with rows and columns. By convention: ``settings``, ``seed``, ``run_id``,
            ``calibration`` (its whole content), ``scanner`` (identities of the devices), ``trace`` (start_ps, step_ps,
            samples, zero_code, mv_per_code). Added here: ``versions``, ``calibration_digest``.

        Raises
        ------
        RecordingError
            If the file exists, the folder cannot be written to, or the header is not complete.
        """
        file = Path(path)
        try:
            text = canonical(complete_header(header))
        except ValueError as error:
            raise RecordingError(file, str(error)) from error
        if not file.parent.is_dir():
            raise RecordingError(file, f"there is no folder {file.parent}", "make it first")
        lock = WriterLock(file)  # first: nobody may take the half-made file for one that was left behind
        try:
            return cls(file, create_database(file, text), lock)
        except RecordingError:
            lock.release()
            raise

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Self:
        """Open a recording for reading; nothing is ever changed in it.

        Raises
        ------
        RecordingError
            If there is none, it is not a recording, or its header is damaged.
        """
        file = Path(path)
        return cls(file, open_database(file, writing=False))

    @classmethod
    def resume(cls, path: str | os.PathLike[str]) -> Self:
        """Open an interrupted recording to go on with the lines in `missing`.

        Lines that fail their check are taken out, with an event that says so, so that they are scanned again.

        Raises
        ------
        RecordingError
            As `open`; if the scan is complete; if another program is writing to it.
        """
        file = Path(path)
        with cls.open(file) as recording:
            damaged = [line for line in recording.check() if not line.ok]
            if recording.complete and not damaged:
                raise RecordingError(file, "holds all its lines; there is nothing to go on with")
            before = recording.stop_reason
            last = recording._value("SELECT coalesce(max(acknowledged_at_s), 0) FROM line")
        lock = WriterLock(file)
        try:
            recording = cls(file, open_database(file, writing=True), lock)
        except RecordingError:
            lock.release()
            raise
        with recording._transaction():
            for line in damaged:
                recording._connection.execute("DELETE FROM line WHERE k = ?", (line.index,))
            recording._connection.execute("UPDATE scan SET stop_reason=NULL, laser_off_verified=NULL, summary=NULL")
        for line in damaged:
            recording.event(last, "line taken out", line=line.index, problem=line.problem)
        recording.event(last, "resumed", stop_reason_before=before)
        return recording

    def registrations(self) -> list[JsonObject]:
        """Return what was registered while the scan was made, in order; mostly none or one.

        Raises
        ------
        RecordingError
            At a damaged one.
        """
        if not self._value(registration_rows.HAS_TABLE):
            return []
        found = self._rows(registration_rows.SELECT_REGISTRATIONS)
        return [registration_rows.registration_of(self.path, row) for row in found]

    @classmethod
    def add_registration(cls, path: str | os.PathLike[str], content: JsonObject) -> None:
        """Write into a recording that was closed what was registered from it.

        Raises
        ------
        RecordingError
            As `open`; if another program is writing to it, or it could not be written.
        """
        file = Path(path)
        refuse_missing(file)
        lock = WriterLock(file)
        try:
            with cls(file, open_database(file, writing=True), lock) as recording:
                recording.append_registration(content)
                to_one_file(recording._connection, file)
        except (sqlite3.Error, OSError) as error:
            raise from_sqlite(file, error) from error
        finally:
            lock.release()


def open_recording(path: str | os.PathLike[str]) -> Recording:
    """Open a recording for reading, as `Recording.open`: ``open_recording("scan.db").cloud()`` has its points.

    Raises
    ------
    RecordingError
        If there is none, it is not a recording, or its header is damaged.

    Examples
    --------
    After ``picoradar scan --target plate --grid 3x3 -o scan.db``:

    >>> from picoradar import open_recording
    >>> with open_recording("scan.db") as recording:
    ...     recording.cloud().points_mm.shape
    (9, 3)
    """
    return Recording.open(path)
