"""One simulated serial device for other programs: a pty and a TCP port that lead to the same connector.

The device has one line, so one host can use it at a time. A host on the TCP port has the line until it closes its
connection; what is written to the pty meanwhile is lost.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from picoradar.sim.ports import SerialWire
from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.socket_end import SocketEnd
from picoradar.sim.server.uart import heard

if TYPE_CHECKING:
    from picoradar.sim.server.pty_end import PtyEnd

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
    """

    def __init__(self, wire: SerialWire, loop: EventLoop, pty_name: Path | None) -> None:
        self._wire = wire
        self._loop = loop
        self._socket = SocketEnd(loop, wire.write)
        self._pty = _make_pty(pty_name, wire.firmware.baud)
        self._present = True
        wire.host_open = True
        wire.piece_bytes = max(1, int(wire.firmware.baud / 10 * PIECE_S * loop.speed))
        self._watch_pty()
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
        self.pull()
        if self._pty is not None:
            self._pty.close()

    def _watch_pty(self) -> None:
        if self._pty is not None:
            self._loop.watch(self._pty.fileno(), self._hear_pty)

    def _hear_pty(self) -> None:
        if self._pty is None:
            return
        data = heard(self._pty.read(), sent_baud=self._pty.baud(), read_baud=self._wire.firmware.baud)
        if data and not self._socket.connected:
            self._wire.write(data)

    def _turn(self) -> None:
        self._follow_cable()
        self._answer()

    def _follow_cable(self) -> None:
        """Take the ports away or put them back when the cable has been pulled or plugged in (also by a fault)."""
        if self._wire.plugged == self._present:
            return
        self._present = self._wire.plugged
        if self._present:
            self._socket.plug()
            if self._pty is not None:
                self._pty.plug()
                self._watch_pty()
            return
        self._wire.discard()
        self._socket.pull()
        if self._pty is not None:
            self._loop.forget(self._pty.fileno())
            self._pty.pull()

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
