"""Reading a recording: header, lines verified by their check sums, events, how it ended."""

from __future__ import annotations

import sqlite3
import threading
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.errors import DECODER_ERRORS, decoder_words
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import ScanLine, ZeroReading
from picoradar.instrument.recording import rows, zero_rows
from picoradar.instrument.recording.cloud import Cloud, cloud_of, range_error_in
from picoradar.instrument.recording.content import FROM_A_COPY, event_of, json_object, refuse_foreign_content
from picoradar.instrument.recording.errors import READING_ERRORS, SALVAGE, RecordingError, from_sqlite
from picoradar.instrument.recording.findings import Event, LineCheck
from picoradar.instrument.recording.header import TraceForm, checked_header


class Reader:
    """What can be read from a recording, while it is written or after.

    Attributes
    ----------
    path : Path
        The file.
    header : dict
        Settings, seed, versions, calibration and its digest, raster, scanner, trace.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection
        self._lock = threading.RLock()
        try:
            refuse_foreign_content(path, connection)
            self.header = self._read_header()
            self._layout = rows.checked_layout(path, self._value("PRAGMA user_version"))
            trace = self.header.get("trace")
            self._form = None if trace is None else TraceForm.of(trace)
        except RecordingError:
            connection.close()
            raise

    def close(self) -> None:
        """Close the file. The lines are safe with or without it."""
        with self._lock:
            self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def raster(self) -> JsonObject:
        """Get rows, columns, step_mm, mode, averages."""
        raster: JsonObject = self.header["raster"]
        return raster

    @property
    def range_error(self) -> JsonObject:
        """Get what `range_error_in` says of all points; the lines are read for it."""
        return range_error_in(self.header, self.cloud(skip_damaged=True))

    @property
    def trace(self) -> JsonObject:
        """Get start_ps, step_ps, samples, zero_code, mv_per_code of the traces.

        Raises
        ------
        RecordingError
            If the recording is one without traces.
        """
        trace = self.header.get("trace")
        if not isinstance(trace, dict):
            raise RecordingError(self.path, "its header says nothing about traces")
        return trace

    @property
    def times_ps(self) -> NDArray[np.float64]:
        """Get the (S,) times of the samples of a trace, ps after the trigger."""
        return TraceForm.of(self.trace).times_ps

    def traces_mv(self, line: ScanLine) -> NDArray[np.float64]:
        """Return the (N, S) averaged traces of a line in mV at the photodiode.

        Raises
        ------
        RecordingError
            If the line was recorded without traces.
        """
        if line.traces is None:
            raise RecordingError(self.path, "was recorded without its traces", line=line.index)
        return line.traces.mv

    @property
    def done(self) -> list[int]:
        """Get the lines that are there, in ascending order."""
        return [int(row[0]) for row in self._rows("SELECT k FROM line WHERE typeof(k)='integer' ORDER BY k")]

    @property
    def missing(self) -> list[int]:
        """Get the lines of the raster that are not there yet."""
        return sorted(set(range(self.raster["rows"])) - set(self.done))

    @property
    def stop_reason(self) -> str | None:
        """Get why the scan ended; None if it was never closed (it runs, or its process died)."""
        reason = self._value("SELECT stop_reason FROM scan")
        if not isinstance(reason, str | None):
            raise RecordingError(self.path, "the reason of its end is no text", FROM_A_COPY)
        return reason

    @property
    def laser_off_verified(self) -> bool | None:
        """Get whether the laser was read back as off at the end; None if the scan was never closed."""
        verified = self._value("SELECT laser_off_verified FROM scan")
        return None if verified is None else bool(verified)

    @property
    def summary(self) -> JsonObject:
        """Get the figures given to `finish`."""
        text = self._value("SELECT summary FROM scan")
        return {} if text is None else json_object(self.path, text, "the summary")

    @property
    def complete(self) -> bool:
        """Get whether the scan was closed and every line of the raster is there."""
        return self.stop_reason is not None and not self.missing

    def line(self, index: int, *, traces: bool = True) -> ScanLine:
        """Return one line, verified.

        Raises
        ------
        RecordingError
            If it is not there, or damaged: which, and how.
        """
        try:
            with self._lock:
                found = rows.fetch(self._connection, self._layout, index, raw=traces)
            if found is None:
                raise RecordingError(self.path, "the line is not in the recording", line=index)
            if not 0 <= index < self.raster["rows"]:
                raise RecordingError(self.path, f"the raster has the lines 0 to {self.raster['rows'] - 1}", line=index)
            return rows.unpack(found, self._form)
        except READING_ERRORS as error:
            raise from_sqlite(self.path, error, line=index) from error
        except DECODER_ERRORS as error:
            raise RecordingError(self.path, f"the line is damaged: {decoder_words(error)}", line=index) from error

    def lines(self, *, traces: bool = True, skip_damaged: bool = False) -> Iterator[ScanLine]:
        """Iterate over the lines, each verified by its check sum.

        Parameters
        ----------
        traces : bool
            Read the raw traces too (most of the file).
        skip_damaged : bool
            Pass over damaged lines; `check` says which they are.

        Raises
        ------
        RecordingError
            At a damaged line.
        """
        for index in self.done:
            try:
                line = self.line(index, traces=traces)
            except RecordingError:
                if not skip_damaged:
                    raise
                continue
            yield line

    def zero_readings(self) -> list[ZeroReading]:
        """Return the raw readings of the zero mark, in order; none in a recording of an earlier layout.

        Raises
        ------
        RecordingError
            At a damaged one.
        """
        found = self._rows(zero_rows.SELECT_ZERO) if self._layout >= zero_rows.FIRST_LAYOUT else []
        return [zero_rows.reading_of(self.path, row, self._form) for row in found]

    def check(self) -> list[LineCheck]:
        """Read every line and its traces; say of each whether it is whole."""
        found = []
        for index in self.done:
            try:
                self.line(index)
            except RecordingError as error:
                found.append(LineCheck(index, error.what))
            else:
                found.append(LineCheck(index))
        return found

    def cloud(self, *, skip_damaged: bool = False) -> Cloud:
        """Return the points of all lines as arrays (without traces), with what lines show of each other in the flags.

        Raises
        ------
        RecordingError
            At a damaged line, unless they are to be skipped.
        """
        lines = self.lines(traces=False, skip_damaged=skip_damaged)
        return cloud_of(lines, raster=self.raster.get("step_mm") is not None, stretch=self.header.get("stretch"))

    def events(self) -> list[Event]:
        """Return what happened, in order."""
        return [event_of(self.path, row) for row in self._rows("SELECT t, kind, state, data FROM event ORDER BY id")]

    def _read_header(self) -> JsonObject:
        found = self._rows("SELECT header, header_crc32 FROM scan")
        if not found:
            raise RecordingError(self.path, "has no header", "it was broken off at its very beginning; scan again")
        text, crc = found[0]
        if not isinstance(text, str) or zlib.crc32(text.encode()) != crc:
            raise RecordingError(self.path, "the check sum of the header does not fit", SALVAGE)
        header = json_object(self.path, text, "the header")
        try:
            return checked_header(header)
        except ValueError as error:
            raise RecordingError(self.path, str(error), FROM_A_COPY) from error

    def _rows(self, query: str) -> list[Any]:
        try:
            with self._lock:
                return self._connection.execute(query).fetchall()
        except READING_ERRORS as error:
            raise from_sqlite(self.path, error) from error

    def _value(self, query: str) -> Any:
        return self._rows(query)[0][0]
