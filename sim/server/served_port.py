"""One simulated serial device for other programs: a pty and a TCP port that lead to the same connector.

The device has one line, so one host can use it at a time. A host on the TCP port has the line until it closes its
connection; what is written to the pty meanwhile is lost. A host that sends faster than the line carries, or asks for
more answers than it carries, has to wait as at a real port: while `LINE_BYTES` are on the line, nothing is read.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from picoradar.sim.ports import SerialWire
from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.socket_end import SocketEnd
from picoradar.sim.server.uart import heard

if TYPE_CHECKING:
    from picoradar.sim.server.pty_end import PtyEnd

LINE_BYTES = 4096  # on the line before a host has to wait; the buffer of a terminal in Linux is as large
PIECE_S = 1e-3  # an answer reaches the host in pieces of this length (wall)


class PortAddresses(TypedDict):
    """Where a host finds one device: ``pty`` (None where there are no ptys) and ``socket``, a URL."""

    pty: str | None
    socket: str


class ServedPort:
    """Pty and TCP port of one device.

    Parameters
    ----------
    wire : SerialWire
        The device's line; its host is from now on the program that opens one of the ports.
    loop : EventLoop
    pty_name : Path or None
        Name for the pty; None where there are none (Windows).

    Raises
    ------
    OSError
        When a terminal, its name or a TCP port cannot be had.
    """

    def __init__(self, wire: SerialWire, loop: EventLoop, pty_name: Path | None) -> None:
        self._wire = wire
        self._loop = loop
        self._pty = _make_pty(pty_name, wire.firmware.baud)
        try:
            self._socket = SocketEnd(loop, wire.write, wire.hang_up)
        except OSError:
            if self._pty is not None:
                self._pty.pull()
                self._pty.close()
            raise
        self._present = True
        self._pty_watched = False
        wire.host_open = True
        wire.piece_bytes = max(1, int(wire.firmware.baud / 10 * PIECE_S * loop.speed))
        self._watch_pty(watched=True)
        loop.every_turn(self._turn)

    @property
    def addresses(self) -> PortAddresses:
        """Get where a host finds the device: ``pty`` (None on Windows) and ``socket``."""
        return {"pty": str(self._pty.name) if self._pty is not None else None, "socket": self._socket.url}

    def pull(self) -> None:
        """Pull the cable out of the host."""
        self._wire.plugged = False
        self._follow_cable()

    def plug(self) -> None:
        """Plug the cable in again: same names, a new terminal."""
        self._wire.plugged = True
        self._follow_cable()

    def close(self) -> None:
        """Take both ports away."""
        self._loop.no_more(self._turn)
        self.pull()
        if self._pty is not None:
            self._pty.close()

    def _watch_pty(self, *, watched: bool) -> None:
        if self._pty is None or watched == self._pty_watched:
            return
        self._pty_watched = watched
        if watched:
            self._loop.watch(self._pty.fileno(), self._hear_pty)
        else:
            self._loop.forget(self._pty.fileno())

    def _hear_pty(self) -> None:
        if self._pty is None:
            return
        data = heard(self._pty.read(), sent_baud=self._pty.baud(), read_baud=self._wire.firmware.baud)
        if data and not self._socket.connected:
            self._wire.write(data)

    def _turn(self) -> None:
        self._follow_cable()
        self._answer()
        if self._present:
            full = self._wire.crossing > LINE_BYTES
            self._socket.hold(held=full)
            self._watch_pty(watched=self._socket.connected or not full)  # what comes beside a TCP host is lost anyway

    def _follow_cable(self) -> None:
        """Take the ports away or put them back when the cable has been pulled or plugged in (also by a fault)."""
        if self._wire.plugged == self._present:
            return
        if self._wire.plugged:
            with contextlib.suppress(OSError):  # no descriptor or port is free now: the next turn tries again
                self._plug_ends()
            return
        self._present = False
        self._wire.hang_up()
        self._socket.pull()
        if self._pty is not None:
            self._watch_pty(watched=False)
            self._pty.pull()

    def _plug_ends(self) -> None:
        if self._pty is not None:
            self._pty.plug()
        try:
            self._socket.plug()
        except OSError:
            if self._pty is not None:
                self._pty.pull()
            raise
        self._watch_pty(watched=True)
        self._present = True

    def _answer(self) -> None:
        """Hand on what has come from the device."""
        if not self._wire.waiting:
            return
        data = self._wire.read(self._wire.waiting, 0.0)
        if self._socket.connected:
            self._socket.write(data)
        elif self._pty is not None:
            self._pty.write(heard(data, sent_baud=self._wire.firmware.baud, read_baud=self._pty.baud()))


def _make_pty(name: Path | None, baud: int) -> PtyEnd | None:
    if name is None:
        return None
    from picoradar.sim.server.pty_end import PtyEnd  # where there are no ptys its imports fail

    return PtyEnd(name, baud)
