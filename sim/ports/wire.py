"""The simulated end of a serial line, in process, on the virtual clock.

A `SerialWire` joins one firmware to one host. Bytes take their time on the line (10 bits a byte at the
device's baud rate); a host that reads moves the clock to the moment the next byte is due.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Protocol

from picoradar.drivers.clock import VirtualClock

WHOLE = 1 << 20  # bytes, more than any answer has


class SerialFirmware(Protocol):
    """A device behind a serial line.

    The firmware receives the stream in chunks of any size, answers through the ``send`` function that it was
    connected to, and sets its own timers on the clock.
    """

    @property
    def baud(self) -> int:
        """Get its present baud rate."""

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with: ``send(data, delay_s)`` puts bytes on the line after a delay."""

    def receive(self, data: bytes) -> None:
        """Take bytes that have arrived from the host."""


class SerialWire:
    """A serial line between host and firmware, both ways.

    Parameters
    ----------
    firmware : SerialFirmware
        The device; its ``baud`` sets the pace.
    clock : VirtualClock
        Time of the bench.

    Attributes
    ----------
    piece_bytes : int
        Number of bytes that reach the host at a time; a shorter answer arrives as a whole, with its last byte.
    """

    def __init__(self, firmware: SerialFirmware, clock: VirtualClock) -> None:
        self.piece_bytes = WHOLE
        self.firmware = firmware
        self.clock = clock
        self.plugged = True
        self.host_open = False
        self._to_host = bytearray()
        self._crossing = 0  # bytes on the line, both ways
        self._hosts = 0  # how many have hung up; bytes of an earlier one are no longer on the line
        self._host_line_free = 0.0
        self._device_line_free = 0.0
        firmware.connect(self._send)

    def write(self, data: bytes) -> None:
        """Take bytes from the host; the device gets them when the last one has crossed the line."""
        arrival = max(self.clock.now(), self._host_line_free) + 10 * len(data) / self.firmware.baud
        self._host_line_free = arrival
        self._put_on_line(arrival, data, self._deliver)

    def read(self, size: int, timeout_s: float | None) -> bytes:
        """Give the host up to ``size`` bytes; waits for them up to ``timeout_s`` (None: without limit)."""
        limit_s = float("inf") if timeout_s is None else timeout_s
        self.clock.wait(lambda: len(self._to_host) >= size or not self.plugged, limit_s)
        got = bytes(self._to_host[:size])
        del self._to_host[: len(got)]
        return got

    @property
    def waiting(self) -> int:
        """Get the number of bytes that the host has received and not read."""
        return len(self._to_host)

    def discard(self) -> None:
        """Discard what the host has received and not read."""
        self._to_host.clear()

    @property
    def crossing(self) -> int:
        """Get the number of bytes that are on the line, on their way to the device or to the host."""
        return self._crossing

    def hang_up(self) -> None:
        """Drop what is on the line, both ways, and what the host has not read: the next host finds it free."""
        self.discard()
        self._hosts += 1
        self._crossing = 0
        self._host_line_free = self._device_line_free = 0.0

    def _put_on_line(self, arrival: float, data: bytes, arrived: Callable[[bytes], None]) -> None:
        self._crossing += len(data)
        self.clock.call_at(arrival, partial(self._cross, self._hosts, data, arrived))

    def _cross(self, host: int, data: bytes, arrived: Callable[[bytes], None]) -> None:
        if host == self._hosts:
            self._crossing -= len(data)
            arrived(data)

    def _deliver(self, data: bytes) -> None:
        if self.plugged:
            self.firmware.receive(data)

    def _send(self, data: bytes, delay_s: float) -> None:
        arrival = max(self.clock.now() + delay_s, self._device_line_free)
        for at in range(0, len(data), self.piece_bytes):
            piece = data[at : at + self.piece_bytes]
            arrival += 10 * len(piece) / self.firmware.baud
            self._put_on_line(arrival, piece, self._arrive)
        self._device_line_free = arrival

    def _arrive(self, data: bytes) -> None:
        if self.host_open and self.plugged:
            self._to_host += data


_wires: dict[str, SerialWire] = {}
_numbers = itertools.count(1)


def publish(bench_name: str, device: str, wire: SerialWire) -> str:
    """Make ``wire`` reachable in this process and return its URL, ``sim://bench/device``."""
    url = f"sim://{bench_name}/{device}"
    _wires[url] = wire
    return url


def withdraw(url: str) -> None:
    """Take a port away, as when a bench is closed."""
    _wires.pop(url, None)


def wire_at(url: str) -> SerialWire | None:
    """Get the wire behind a ``sim://`` URL; None when there is no such port."""
    return _wires.get(url)


def new_bench_name() -> str:
    """Make a name that is unique in this process."""
    return f"bench{next(_numbers)}"
