"""One writer a recording, across processes: a lock that the operating system gives up when its holder dies."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from picoradar.instrument.recording.errors import RecordingError

if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> None:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


class WriterLock:
    """Held from creation to `release`, on a small file beside the recording.

    Not on the recording itself: closing any handle of a file gives up all POSIX locks that the process has on it, and
    SQLite's are among them.

    Raises
    ------
    RecordingError
        If another program writes to the recording, or the folder cannot be written to.
    """

    def __init__(self, recording: Path) -> None:
        self._file = recording.with_name(f"{recording.name}-writer")
        try:
            self._handle = os.open(self._file, os.O_CREAT | os.O_RDWR, 0o600)
        except OSError as error:
            what = f"its folder cannot be written to ({error.strerror})"
            raise RecordingError(recording, what, "copy the recording to a folder that you may write to") from error
        try:
            _lock(self._handle)
            if os.fstat(self._handle).st_nlink == 0:
                raise OSError("the other writer took the file away just now")
        except OSError as error:
            os.close(self._handle)
            raise RecordingError(recording, "another program is writing to it", "end that program first") from error
        self._held = True

    def release(self) -> None:
        """Give the lock up and take its file away; once or more often."""
        if self._held:
            self._held = False
            if sys.platform != "win32":  # there, a file that is open cannot be taken away
                self._file.unlink(missing_ok=True)
            os.close(self._handle)
            if sys.platform == "win32":
                self._file.unlink(missing_ok=True)
