"""A pseudo-terminal as the connector of a simulated serial device (POSIX only).

The host opens a name that survives unplugging, as udev's by-id names do. Raw mode is set at once: until then the
terminal would echo what the device sends back to it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import struct
import sys
import termios
import tty
from pathlib import Path

CHUNK = 1024
_TCGETS2 = 0x802C542A  # Linux: termios2, which holds baud rates that have no name
_TERMIOS2 = struct.Struct("4I20B2I")
_NAMED_BAUDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}


class PtyEnd:
    """One pseudo-terminal; `pull` and `plug` are those of its cable.

    Parameters
    ----------
    name : Path
        Name for the host (a symbolic link to the terminal); its folder exists.
    baud : int
        Rate that a host finds when it does not set one.
    """

    def __init__(self, name: Path, baud: int) -> None:
        self.name = name
        self._baud = baud
        self._terminal = ""  # what our name leads to
        self._master = self._slave = -1
        self.plug()

    def fileno(self) -> int:
        """Get the descriptor of our side."""
        return self._master

    def plug(self) -> None:
        """Make the terminal and put its name in place, in one step.

        Raises
        ------
        OSError
            When there is no terminal to be had, or the name cannot be made.
        """
        self._master, self._slave = os.openpty()
        try:
            tty.setraw(self._slave)
            settings = termios.tcgetattr(self._slave)
            settings[4] = settings[5] = getattr(termios, f"B{self._baud}", settings[5])
            termios.tcsetattr(self._slave, termios.TCSANOW, settings)
            os.set_blocking(self._master, False)
            # The slave stays open on our side: else reading ends with an error whenever no host has it open.
            self._terminal = os.ttyname(self._slave)
            if self.name.exists() and not self.name.is_symlink():
                raise FileExistsError(f"{self.name} is there already, and no name of a terminal")
            new = self.name.with_name(self.name.name + ".new")
            new.unlink(missing_ok=True)  # of a server that was killed at this very place
            new.symlink_to(self._terminal)
            new.replace(self.name)
        except OSError:
            self.pull()
            raise

    def pull(self) -> None:
        """Pull the cable: a waiting host gets its error at once; the name stays and leads nowhere."""
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    def close(self) -> None:
        """Take the name away, after a `pull`, if it is still ours."""
        with contextlib.suppress(OSError):
            if os.readlink(self.name) == self._terminal:
                self.name.unlink()

    def read(self) -> bytes:
        """Take what the host has written."""
        try:
            return os.read(self._master, CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        """Give bytes to the host; those for which its buffer has no room are lost, as with a real port."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)

    def baud(self) -> float:
        """Get the baud rate that the host has set; 0 when it has hung up."""
        speed = termios.tcgetattr(self._master)[5]
        if speed in _NAMED_BAUDS:
            return _NAMED_BAUDS[speed]
        if sys.platform != "linux":
            return float(speed)
        answer = fcntl.ioctl(self._master, _TCGETS2, bytes(_TERMIOS2.size))
        return float(_TERMIOS2.unpack(answer)[-1])
