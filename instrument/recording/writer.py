"""Writing a recording: lines, events and the end, each durable when the call returns."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import ScanLine, ZeroReading
from picoradar.instrument.recording import registration_rows, rows, zero_rows
from picoradar.instrument.recording.database import checkpoint_if_long, to_one_file
from picoradar.instrument.recording.errors import RecordingError, from_sqlite, primary_code
from picoradar.instrument.recording.header import canonical
from picoradar.instrument.recording.reader import Reader
from picoradar.instrument.recording.writer_lock import WriterLock


class Writer(Reader):
    """What can be written to a recording, by the one who holds its lock.

    Parameters
    ----------
    path : Path
    connection : sqlite3.Connection
    lock : WriterLock, optional
        Without it, everything but reading is refused.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection, lock: WriterLock | None = None) -> None:
        super().__init__(path, connection)
        self._lock_of_writer = lock
        self._writing = lock is not None
        self._why_not = "" if self._writing else " (it was opened for reading)"

    def close(self) -> None:
        """Close the file. The lines are safe with or without it."""
        super().close()
        self._release()

    def append(self, line: ScanLine, *, acknowledged_at_s: float | None = None) -> None:
        """Write a line; on return it is on the disk. Hand a line to nobody before.

        Parameters
        ----------
        line : ScanLine
            A row of the raster that is not there yet.
        acknowledged_at_s : float, optional
            Device time now; without it, the time at which the line was begun.

        Raises
        ------
        RecordingError
            If it could not be made durable: then it is not in the recording, and the lines before it are. Or, with
            the line safe, if the disk failed while old lines were moved from the WAL into the file.
        """
        if not 0 <= line.index < self.raster["rows"]:
            raise RecordingError(self.path, f"the raster has the lines 0 to {self.raster['rows'] - 1}", line=line.index)
        if self._form is None and (line.traces is not None or line.windows is not None):
            raise RecordingError(self.path, "its header says nothing about traces", line=line.index)
        acknowledged = line.device_time_s if acknowledged_at_s is None else acknowledged_at_s
        try:
            packed = rows.pack(line, acknowledged)
        except ValueError as error:
            raise RecordingError(self.path, str(error), line=line.index) from error
        with self._transaction(line.index):
            self._connection.execute(rows.INSERT_LINE, packed.line)
            if packed.wave is not None:
                self._connection.execute(rows.INSERT_WAVE, packed.wave)
            if packed.window is not None:
                self._connection.execute(rows.INSERT_WINDOW, packed.window)
            if packed.echo is not None:
                self._connection.execute(rows.INSERT_ECHO, packed.echo)
            if packed.stretch is not None:
                self._connection.execute(rows.INSERT_STRETCH, packed.stretch)
        with self._lock:
            try:
                checkpoint_if_long(self._connection, self.path)
            except sqlite3.Error as error:
                raise self._failure(error, line.index) from error

    def append_zero(self, reading: ZeroReading) -> None:
        """Write a reading of the zero mark, and how many lines there are before it (durable on return).

        Raises
        ------
        RecordingError
            If it could not be written.
        """
        number = 1 + int(self._value("SELECT coalesce(max(id), 0) FROM zero"))
        lines = len(self.done) if reading.lines is None else reading.lines
        try:
            row = zero_rows.pack_zero(number, reading, lines)
        except ValueError as error:
            raise RecordingError(self.path, f"the reading of the zero mark: {error}") from error
        with self._transaction():
            self._connection.execute(zero_rows.INSERT_ZERO, row)

    def append_registration(self, content: JsonObject) -> None:
        """Write what was registered from the lines that there are, with its digest (durable on return).

        Raises
        ------
        RecordingError
            If it could not be written.
        """
        lines = len(self.done)
        try:
            with self._transaction():
                registration_rows.append_row(self._connection, content, lines)
        except ValueError as error:
            raise RecordingError(self.path, f"the registration: {error}") from error

    def event(self, time_s: float, kind: str, *, state: str | None = None, **fields: object) -> None:
        """Write down what happened (durable on return).

        Parameters
        ----------
        time_s : float
            Device time.
        kind : str
            What it is, for example ``"state"``, ``"alarm"``, ``"laser off"``.
        state : str, optional
            State of the controller.
        **fields
            Anything that has a JSON form.

        Raises
        ------
        RecordingError
            If it could not be written.
        """
        data = self._text(f"event '{kind}'", fields)
        with self._transaction():
            self._connection.execute(
                "INSERT INTO event (t, kind, state, data) VALUES (?, ?, ?, ?)", (float(time_s), kind, state, data)
            )

    def finish(self, stop_reason: str, *, laser_off_verified: bool, **summary: object) -> bool:
        """Close the scan: write how it ended, and bring everything into the one file.

        Parameters
        ----------
        stop_reason : str
            For example ``"finished"``, ``"aborted by the operator"``, the cause of a fault.
        laser_off_verified : bool
            Whether the read-back of the safe shutdown showed the laser off.
        **summary
            Figures of the scan (device time, flags ...).

        Returns
        -------
        bool
            True if the file stands alone now; False while another program still reads it: then copy it together with
            its ``-wal`` file, or open and finish it later.

        Raises
        ------
        RecordingError
            If it could not be written.
        """
        figures = self._text("summary", summary)
        with self._lock:
            with self._transaction():
                self._connection.execute(
                    "UPDATE scan SET stop_reason = ?, laser_off_verified = ?, summary = ?",
                    (stop_reason, int(laser_off_verified), figures),
                )
            self._writing, self._why_not = False, ": the scan was closed"
            try:
                return to_one_file(self._connection, self.path)
            except (sqlite3.Error, OSError) as error:
                raise self._failure(error, None) from error
            finally:
                self._release()

    def _text(self, name: str, content: dict[str, object]) -> str:
        try:
            return canonical(content)
        except ValueError as error:
            raise RecordingError(self.path, f"{name}: {error}") from error

    @contextmanager
    def _transaction(self, line: int | None = None) -> Iterator[None]:
        """Run statements as one durable transaction; nothing of it remains if it fails."""
        with self._lock:
            if not self._writing:
                raise RecordingError(self.path, f"is not open for writing{self._why_not}", line=line)
            try:
                self._connection.execute("BEGIN IMMEDIATE")
                yield
                self._connection.execute("COMMIT")
            except sqlite3.Error as error:
                raise self._failure(error, line) from error
            finally:
                self._roll_back()

    def _release(self) -> None:
        if self._lock_of_writer is not None:
            self._lock_of_writer.release()

    def _roll_back(self) -> None:
        if self._connection.in_transaction:
            with suppress(sqlite3.Error):  # the transaction is gone with the connection in any case
                self._connection.execute("ROLLBACK")

    def _failure(self, error: sqlite3.Error | OSError, line: int | None) -> RecordingError:
        """Undo the line, count what is safe, and after an input/output error write no more.

        A failed fsync leaves unknown what reached the disk, and a second one may report success all the same.
        """
        self._roll_back()
        try:
            kept: int | None = len(self.done)
        except RecordingError:
            kept = None
        failure = from_sqlite(self.path, error, line=line, kept=kept)
        if primary_code(error) in (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CORRUPT):
            self._writing = False
            self._why_not = f" any more: {failure.what}"
        return failure
