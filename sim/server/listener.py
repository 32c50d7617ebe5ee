"""`Listener`: a TCP port on this computer that survives what its hosts do, and a computer without free descriptors."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from picoradar.sim.server.event_loop import EventLoop

LOOPBACK = "127.0.0.1"
RETRY_S = 0.5  # wall time until the next attempt after one that failed for want of a descriptor or of memory
# A host that vanished without a word (its computer lost power, a tunnel broke) is noticed after 30 + 3 x 10 s.
KEEP_ALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3}


class Listener:
    """Accepts hosts and hands their connections on.

    Parameters
    ----------
    loop : EventLoop
        Reports when a host connects.
    accepted : callable
        Takes the connection of each host, with its options set.
    port : int
        Number of the port; 0 takes a free one.
    receive_bytes : int, optional
        Size of the buffer of each connection; the system's default without it.

    Raises
    ------
    OSError
        When the port cannot be had.
    """

    def __init__(
        self,
        loop: EventLoop,
        accepted: Callable[[socket.socket], None],
        port: int = 0,
        *,
        receive_bytes: int | None = None,
    ) -> None:
        self._loop = loop
        self._accepted = accepted
        self._again_s: float | None = None  # when to listen again, on the monotonic clock; None while listening
        self._socket = socket.create_server((LOOPBACK, port))
        self._socket.setblocking(False)
        if receive_bytes is not None:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)  # its connections inherit it
        self.port: int = self._socket.getsockname()[1]
        loop.watch(self._socket, self._accept)
        loop.every_turn(self._turn)

    def close(self) -> None:
        """Listen no more."""
        if self._again_s is None:
            self._loop.forget(self._socket)
        self._loop.no_more(self._turn)
        self._socket.close()

    def _accept(self) -> None:
        try:
            connection, _ = self._socket.accept()
        except (BlockingIOError, ConnectionError):  # the host has gone again
            return
        except OSError:
            # The host stays in the system's queue, so that the port would be reported as ready again at once.
            self._loop.forget(self._socket)
            self._again_s = time.monotonic() + RETRY_S
            return
        try:
            _set_options(connection)
        except OSError:  # the host has gone again
            connection.close()
            return
        self._accepted(connection)

    def _turn(self) -> None:
        if self._again_s is not None and time.monotonic() >= self._again_s:
            self._again_s = None
            self._loop.watch(self._socket, self._accept)


def _set_options(connection: socket.socket) -> None:
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in KEEP_ALIVE.items():
        if (option := getattr(socket, name, None)) is not None:  # not every system has all three
            connection.setsockopt(socket.IPPROTO_TCP, option, value)
