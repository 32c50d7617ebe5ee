"""A TCP port on this computer as the connector of a simulated serial device, for ``socket://`` and for Windows."""

from __future__ import annotations

import contextlib
import socket
import sys
from collections.abc import Callable

from picoradar.sim.server.event_loop import EventLoop

LOOPBACK = "127.0.0.1"
CHUNK = 4096


class SocketEnd:
    """One port that serves one host at a time: a second one is turned away at once.

    Parameters
    ----------
    loop : EventLoop
        Reports when a host connects and when it writes.
    received : callable
        Called with the bytes that the host has written.
    """

    def __init__(self, loop: EventLoop, received: Callable[[bytes], None]) -> None:
        self._loop = loop
        self._received = received
        self._host: socket.socket | None = None
        self._listener: socket.socket | None = None
        self._port = 0
        self.plug()

    @property
    def url(self) -> str:
        """Get the URL for pyserial."""
        return f"socket://{LOOPBACK}:{self._port}"

    @property
    def connected(self) -> bool:
        """Get whether a host is there."""
        return self._host is not None

    def plug(self) -> None:
        """Listen, on the same port as before a `pull`."""
        self._listener = socket.create_server((LOOPBACK, self._port))
        self._port = self._listener.getsockname()[1]
        self._loop.watch(self._listener, self._accept)

    def pull(self) -> None:
        """Pull the cable: the host loses its connection and cannot make another."""
        self._hang_up()
        listener, self._listener = self._listener, None
        if listener is not None:
            self._loop.forget(listener)
            listener.close()

    def write(self, data: bytes) -> None:
        """Give bytes to the host; those for which there is no room are lost, as with a real port."""
        if self._host is not None:
            with contextlib.suppress(BlockingIOError, ConnectionError):  # a lost host shows when it is read from
                self._host.send(data)

    def _accept(self) -> None:
        if self._listener is None:
            return
        host, _ = self._listener.accept()
        if self._host is not None:
            host.close()
            return
        host.setblocking(False)
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        _acknowledge_at_once(host)
        self._host = host
        self._loop.watch(host, self._read)

    def _read(self) -> None:
        if self._host is None:
            return
        try:
            data = self._host.recv(CHUNK)
        except BlockingIOError:
            return
        except ConnectionError:
            data = b""
        if data:
            _acknowledge_at_once(self._host)
            self._received(data)
        else:
            self._hang_up()

    def _hang_up(self) -> None:
        host, self._host = self._host, None
        if host is not None:
            self._loop.forget(host)
            host.close()


def _acknowledge_at_once(host: socket.socket) -> None:
    """Acknowledge what has come now; a host with Nagle's algorithm (pyserial) holds back its next bytes until then.

    The wait, 40 ms and more, would look like a slow device. Linux forgets the option, so it is set again for each read.
    """
    if sys.platform == "linux":
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
