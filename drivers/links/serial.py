"""A serial line as the drivers see it: bytes, time limits and one family of errors.

Ports are opened by URL (``serial.serial_for_url``): a port name, ``socket://host:port``, ``rfc2217://host:port``, or
``sim://`` for a simulated device in the same process; all others are refused (`addresses`). No exception of pyserial,
termios or the operating system leaves this class: they become `LinkLost`, `Timeout` or `ProtocolError`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import NoReturn, TypeVar

import serial

from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import LinkLost, ProtocolError, Timeout
from picoradar.drivers.links.addresses import check_port_file, checked_address
from picoradar.drivers.links.port_trouble import port_errors, remedy_for
from picoradar.drivers.links.transcript import TranscribedLink

MAX_AT_ONCE = 4096
SLICE_S = 0.05  # longest wait inside the port, so that timers (heartbeats) also run on a real clock

T = TypeVar("T")

_PORT_ERRORS = port_errors()


class SerialLink(TranscribedLink):
    """One serial port, owned by one driver.

    Parameters
    ----------
    url : str
        Port name or URL, for example ``COM3``, ``/dev/ttyUSB0``, ``socket://localhost:5025``.
    clock : Clock
        Time for all limits.
    device : str
        The device's name for messages.
    baud : int
        Bits per second; 8 data bits, no parity, 1 stop bit (all devices of this bench).
    timeout_s : float
        Default time limit of one answer.
    """

    def __init__(self, url: str, clock: Clock, *, device: str, baud: int, timeout_s: float = 1.0) -> None:
        super().__init__(clock, device)
        self.url = url
        self.device = f"{device} ({url})"
        self.baud = baud
        self.timeout_s = timeout_s
        self._port: serial.Serial | None = None
        self._received = bytearray()
        self._asked = b""  # what was sent last, for the message of a timeout

    @property
    def is_open(self) -> bool:
        """Get whether the port is open."""
        return self._port is not None

    def open(self) -> None:
        """Open the port and discard what waits in it.

        Raises
        ------
        LinkLost
            When the port is not there, is in use, or may not be opened; when the address is of a kind that is not
            opened at all.
        """
        if self.is_open:
            return
        try:
            check_port_file(checked_address(self.url))
            port = serial.serial_for_url(
                self.url,
                baudrate=self.baud,
                timeout=self.clock.port_wait_s(SLICE_S),
                write_timeout=self.clock.port_wait_s(self.timeout_s),
                exclusive=True,
            )
        except ValueError as error:
            raise LinkLost(self.device, str(error), "check the settings") from error
        except _PORT_ERRORS as error:
            raise LinkLost(self.device, f"cannot open the port: {error}", remedy_for(self.url, error)) from error
        self._port = port
        self._note("open", url=self.url, baud=self.baud)
        self.discard_input()

    def close(self) -> None:
        """Close the port; harmless when it is closed or has vanished."""
        port, self._port = self._port, None
        self._received.clear()
        if port is not None:
            with contextlib.suppress(*_PORT_ERRORS):  # a vanished port cannot be closed in order
                port.close()
            self._note("close")

    def write(self, data: bytes) -> None:
        """Send all of ``data``.

        Raises
        ------
        LinkLost
            When the port has vanished.
        Timeout
            When the device does not take the bytes.
        """
        self._asked = data
        try:
            self._opened().write(data)
        except serial.SerialTimeoutException as error:
            raise Timeout(self.device, f"did not take {len(data)} bytes", "check cable and handshake") from error
        except _PORT_ERRORS as error:
            self._lost(error)
        self._note("write", data)

    def read_until(self, terminator: bytes, *, timeout_s: float | None = None, limit: int = 4096) -> bytes:
        """Read up to and including ``terminator``.

        Raises
        ------
        Timeout
            When it does not come within ``timeout_s`` (default: the link's); names what came instead.
        ProtocolError
            When more than ``limit`` bytes come without it.
        LinkLost
            When the port has vanished.
        """
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        return self._read_line(terminator, self.clock.now() + limit_s, limit_s, limit)

    def read_match(
        self,
        terminator: bytes,
        match: Callable[[bytes], T | None],
        *,
        timeout_s: float | None = None,
        limit: int = 4096,
    ) -> T:
        """Read lines until ``match(line)`` is not None and return its result; the other lines are dropped.

        Parameters
        ----------
        terminator : bytes
            What ends a line.
        match : callable
            Gets one line, with its terminator; returns None for a line that is not wanted.
        timeout_s : float, optional
            Time limit for all lines together (default: the link's).
        limit : int
            Longest line.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            As `read_until` does.
        """
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        end = self.clock.now() + limit_s
        while True:
            found = match(self._read_line(terminator, end, limit_s, limit))
            if found is not None:
                return found

    def take_line(self, terminator: bytes) -> bytes | None:
        """Take one line with its terminator if it has come, without waiting; None while it is under way."""
        came = self.take_leftover(ahead=True)
        line, found, rest = came.partition(terminator)
        self._received += rest if found else came
        return line + found if found else None

    def drain(self, *, quiet_s: float, limit: int = 4096) -> bytes:
        """Read until the line has been quiet for ``quiet_s`` and return what came.

        Gives up on a line that stays busy after the link's time limit, or ``limit`` bytes.
        """
        end = self.clock.now() + quiet_s
        last = end + self.timeout_s
        while (left_s := min(end, last) - self.clock.now()) > 0 and len(self._received) < limit:
            if self._receive(left_s):
                end = self.clock.now() + quiet_s
        got = bytes(self._received)
        self._received.clear()
        return got

    def take_leftover(self, **told: object) -> bytes:
        """Take what came and was not read (late, unsolicited), without waiting; ``told`` is for the transcript."""
        port = self._opened()
        try:
            if waiting := port.in_waiting:
                chunk = port.read(waiting)
                self._received += chunk
                self._note("read", chunk, **told)
        except _PORT_ERRORS as error:
            self._lost(error)
        got = bytes(self._received)
        self._received.clear()
        return got

    def discard_input(self) -> None:
        """Discard what has been received and not read (late answers to earlier queries)."""
        self._received.clear()
        try:
            self._opened().reset_input_buffer()
        except _PORT_ERRORS as error:
            self._lost(error)

    def _read_line(self, terminator: bytes, end: float, limit_s: float, limit: int) -> bytes:
        while (at := self._received.find(terminator)) < 0:
            if len(self._received) >= limit:
                tail = bytes(self._received[-16:])
                raise ProtocolError(self.device, f"{limit} bytes without an end of line; last {tail!r}")
            left_s = end - self.clock.now()
            if left_s <= 0:
                came = f"only {bytes(self._received)!r}" if self._received else "nothing"
                remedy = "check power, cable and baud rate"
                raise Timeout(self.device, f"no answer to {self._asked!r} within {limit_s:g} s, {came} came", remedy)
            self._receive(left_s)
        line = bytes(self._received[: at + len(terminator)])
        del self._received[: len(line)]
        return line

    def _receive(self, left_s: float) -> int:
        """Wait up to one slice for bytes, take all that are there, and return how many came."""
        port = self._opened()
        limit_s = self.clock.port_wait_s(min(left_s, SLICE_S))
        try:
            if port.timeout != limit_s:
                port.timeout = limit_s
            chunk = port.read(port.in_waiting or 1)
            while len(chunk) < MAX_AT_ONCE and (more := port.in_waiting):  # for a socket it never reports more than 1
                chunk += port.read(more)
        except _PORT_ERRORS as error:
            self._lost(error)
        self._received += chunk
        if chunk:
            self._note("read", chunk)
        self.clock.run_due()
        return len(chunk)

    def _opened(self) -> serial.Serial:
        if self._port is None:
            raise LinkLost(self.device, "the port is not open", "connect first")
        return self._port

    def _lost(self, error: BaseException) -> NoReturn:
        self._note("lost", error=str(error))
        self.close()
        raise LinkLost(self.device, f"the port has gone: {error}", "plug the cable in and connect again") from error
