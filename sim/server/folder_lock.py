"""`FolderLock`: a folder belongs to one server at a time.

The lock is the operating system's, on a file in the folder: it ends with the process, however that ends, so a file that
a killed server has left behind is taken over.
"""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

NAME = "picoradar-sim.lock"

if sys.platform == "win32":
    import msvcrt

    _PLACE = 1 << 20  # the lock keeps others from reading the byte there; the process number stands at the beginning

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, _PLACE, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        os.lseek(descriptor, 0, os.SEEK_SET)
else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


class FolderInUse(OSError):
    """Another server, which is alive, owns the folder."""


class FolderLock:
    """Owns a folder until `release`.

    Parameters
    ----------
    folder : Path
        It exists.

    Raises
    ------
    FolderInUse
        When a live server owns it.
    OSError
        When the file of the lock cannot be made or locked.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._descriptor = self._take()
        os.ftruncate(self._descriptor, 0)
        os.write(self._descriptor, f"{os.getpid()}\n".encode("ascii"))

    def release(self) -> None:
        """Give the folder up; harmless when called again."""
        if self._descriptor < 0:
            return
        if os.name == "posix":
            self._path.unlink(missing_ok=True)  # before the lock ends: afterwards it may be that of another one
        os.close(self._descriptor)
        self._descriptor = -1
        if os.name != "posix":
            with contextlib.suppress(OSError):  # there, an open file cannot be removed, ours or that of another one
                self._path.unlink()

    def _take(self) -> int:
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
            try:
                _lock(descriptor)
            except (BlockingIOError, PermissionError) as error:
                owner = os.read(descriptor, 20).decode("ascii", "replace").strip()
                os.close(descriptor)
                raise FolderInUse(
                    f"{self._path.parent}: another picoradar sim (process {owner}) serves there"
                ) from error
            except OSError:
                os.close(descriptor)
                raise
            if self._is_named(descriptor):
                return descriptor
            os.close(descriptor)  # its owner has removed it between opening and locking

    def _is_named(self, descriptor: int) -> bool:
        try:
            return os.path.samestat(os.fstat(descriptor), self._path.stat())
        except FileNotFoundError:
            return False
