"""A TCP port on this computer as the connector of a simulated serial device, for ``socket://`` and for Windows."""

from __future__ import annotations

import contextlib
import socket
import sys
from collections.abc import Callable

from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.listener import LOOPBACK, Listener

CHUNK = 1024
# Of the system, for what the host has sent and nobody has read. The default takes megabytes, an hour of a slow line.
RECEIVE_BYTES = 8192


class SocketEnd:
    """One port that serves one host at a time.

    A second host is turned away at once, unless the first one has sent more than its line takes and some of that has
    not been read yet. It may have gone long ago, which shows only after its last byte; so the one that comes has the
    port.

    Parameters
    ----------
    loop : EventLoop
        Reports when a host connects and when it writes.
    received : callable
        Called with the bytes that the host has written.
    other_host : callable
        Called when a host has come, and when it has gone: what is on the line is nobody's now.

    Raises
    ------
    OSError
        When there is no port to be had.
    """

    def __init__(self, loop: EventLoop, received: Callable[[bytes], None], other_host: Callable[[], None]) -> None:
        self._loop = loop
        self._received = received
        self._other_host = other_host
        self._host: socket.socket | None = None
        self._held = False
        self._behind = False  # held once, and since then there was always more to read
        self._listener: Listener | None = None
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
        """Listen, on the same port as before a `pull`.

        Raises
        ------
        OSError
            When the port cannot be had.
        """
        self._listener = Listener(self._loop, self._accept, self._port, receive_bytes=RECEIVE_BYTES)
        self._port = self._listener.port

    def pull(self) -> None:
        """Pull the cable: the host loses its connection and cannot make another."""
        self._hang_up()
        listener, self._listener = self._listener, None
        if listener is not None:
            listener.close()

    def hold(self, *, held: bool) -> None:
        """Stop reading what the host writes, or go on; meanwhile the system's buffer fills and the host has to wait."""
        if self._host is None or held == self._held:
            return
        self._held = held
        if held:
            self._behind = True
            self._loop.forget(self._host)
        else:
            self._loop.watch(self._host, self._read)

    def write(self, data: bytes) -> None:
        """Give bytes to the host; those for which there is no room are lost, as with a real port."""
        if self._host is not None:
            with contextlib.suppress(BlockingIOError, ConnectionError):  # a lost host shows when it is read from
                self._host.send(data)

    def _accept(self, host: socket.socket) -> None:
        if self._host is not None:
            if not self._behind:
                host.close()
                return
            self._hang_up()
        host.setblocking(False)
        self._host = host
        self._other_host()
        self._loop.watch(host, self._read)

    def _read(self) -> None:
        if self._host is None:
            return
        try:
            data = self._host.recv(CHUNK)
            if data:
                _acknowledge_at_once(self._host)
        except BlockingIOError:
            return
        except OSError:  # reset, or no longer there (keep-alive)
            data = b""
        self._behind &= len(data) == CHUNK
        if data:
            self._received(data)
        else:
            self._hang_up()

    def _hang_up(self) -> None:
        host, self._host = self._host, None
        if host is None:
            return
        if not self._held:
            self._loop.forget(host)
        self._held = self._behind = False
        host.close()
        self._other_host()


def _acknowledge_at_once(host: socket.socket) -> None:
    """Acknowledge what has come now; a host with Nagle's algorithm (pyserial) holds back its next bytes until then.

    The wait, 40 ms and more, would look like a slow device. Linux forgets the option, so it is set again for each read.
    """
    if sys.platform == "linux":
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
