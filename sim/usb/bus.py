"""One plugged-in device on the simulated bus: transfers, halts, claims, and the time that they take.

Full speed has frames of 1 ms and moves at most 19 packets of 64 bytes in each; high speed has microframes of
125 us and moves about 40 MB/s. A transfer ends with the frame in which its last packet moved; an
interrupt endpoint is polled at its interval.
"""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Callable, Iterable
from typing import NamedTuple

from picoradar.drivers.clock import Clock
from picoradar.sim.usb import descriptors as d
from picoradar.sim.usb import errors
from picoradar.sim.usb.firmware import Setup, UsbFirmware, UsbStall

_FRAME_S = {d.FULL_SPEED: 1e-3, d.HIGH_SPEED: 125e-6}
_BYTES_PER_S = {d.FULL_SPEED: 19 * 64 / 1e-3, d.HIGH_SPEED: 40e6}
NAK_RETRY_S = 125e-6


class InTransfer(NamedTuple):
    """Data on their way to the host; ``ended`` when a short (or zero-length) packet closes them."""

    data: bytes
    ended: bool = True


class SimUsbDevice:
    """A device from plug to unplug; plugged in again it is another one, at a new address.

    Parameters
    ----------
    firmware : UsbFirmware
        What it does.
    clock : Clock
        Time of the bench.
    address : int
        Address on the bus.

    Attributes
    ----------
    tamper : callable, optional
        ``tamper(endpoint, data)`` returns the `InTransfer` list that crosses the bus in place of one whole IN transfer:
        the seam for faults (lost, split, joined or damaged transfers, missing zero-length packets).
    """

    def __init__(self, firmware: UsbFirmware, clock: Clock, address: int) -> None:
        self.firmware = firmware
        self.descriptors = firmware.descriptors
        self.clock = clock
        self.address = address
        self.plugged = True
        self.configuration = self.descriptors.configurations[0].bConfigurationValue  # as an operating system leaves it
        self.alternates: dict[int, int] = {}
        self.claims: dict[int, object] = {}
        self.halted: set[int] = set()
        self.tamper: Callable[[int, bytes], Iterable[InTransfer]] | None = None
        self._moving: dict[int, list[InTransfer]] = {}
        self._frame_s = _FRAME_S[self.descriptors.speed]
        self._bytes_per_s = _BYTES_PER_S[self.descriptors.speed]
        self._endpoints = self._active_endpoints()

    def unplug(self) -> None:
        """Pull the cable."""
        self.plugged = False
        self.firmware.bus_reset()

    def check_plugged(self) -> None:
        """Refuse everything once the cable is pulled."""
        if not self.plugged:
            raise errors.gone()

    def configure(self, value: int) -> None:
        """Select a configuration; 0 is the unconfigured state."""
        if value and value not in {c.bConfigurationValue for c in self.descriptors.configurations}:
            raise errors.not_found(f"configuration {value}")
        self.configuration = value
        self._restart()
        self.firmware.configured(value)
        self._pass_frame()

    def select_alternate(self, interface: int, alternate: int) -> None:
        """Select an alternate setting of an interface.

        Takes no time: a forgotten handle comes here from garbage collection, which must not move the clock.
        """
        settings = {(i.bInterfaceNumber, i.bAlternateSetting) for i in self._active_interfaces()}
        if (interface, alternate) not in settings:
            raise errors.not_found(f"alternate setting {alternate} of interface {interface}")
        self.alternates[interface] = alternate
        self._endpoints = self._active_endpoints()
        self.firmware.alternate_selected(interface, alternate)

    def reset(self) -> None:
        """Reset the port; the device keeps its address and loses all settings."""
        self._restart()
        self.firmware.bus_reset()
        self._pass_frame()

    def clear_halt(self, endpoint: int) -> None:
        """Take an endpoint out of its halt."""
        self._endpoint(endpoint)
        self.halted.discard(endpoint)
        self._moving.pop(endpoint, None)
        self.firmware.halt_cleared(endpoint)
        self._pass_frame()

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a control transfer; it takes the frames that its stages need."""
        self.check_plugged()
        self._pass_frame(setup.length)
        self.check_plugged()
        try:
            if setup.request_type & 0x60 == 0:
                return self._standard(setup)[: setup.length]
            return self.firmware.control(setup, data)[: setup.length]
        except UsbStall as refusal:
            raise errors.stalled() from refusal

    def write(self, endpoint: int, data: bytes, timeout_s: float) -> int:
        """Move one OUT transfer; waits while the device is busy and returns the bytes that it took."""
        end = self.clock.now() + timeout_s
        self.send(endpoint, data)
        while not self.offer(endpoint, data):
            left_s = end - self.clock.now()
            if left_s <= 0:
                raise errors.timed_out()
            self.clock.sleep(min(left_s, NAK_RETRY_S))
        return len(data)

    def send(self, endpoint: int, data: bytes) -> None:
        """Let the time pass that ``data`` need on the bus."""
        self._pass_frame(len(data), self._endpoint(endpoint))

    def offer(self, endpoint: int, data: bytes) -> bool:
        """Offer an OUT transfer once; False when the device is busy (NAK)."""
        self._endpoint(endpoint)
        self._check_halt(endpoint)
        try:
            return self.firmware.receive(endpoint, data)
        except UsbStall as stall:
            self.halted.add(endpoint)
            raise errors.stalled() from stall

    def read_into(self, endpoint: int, buffer: array[int], timeout_s: float) -> int:
        """Move one IN transfer into ``buffer`` and return its length.

        It ends with a short packet, with the buffer full, or with the time limit; what came before the limit counts.
        """
        found = self._endpoint(endpoint)
        view = memoryview(buffer)
        end = self.clock.now() + timeout_s
        got = 0
        while got < len(view):
            if not self.ready(endpoint):
                left_s = end - self.clock.now()
                if not self.clock.wait(lambda: self.ready(endpoint), max(0.0, left_s)):
                    if got:
                        return got
                    raise errors.timed_out()
            moved, ended = self._move(found, view[got:])
            got += moved
            self._pass_frame(moved, found)
            self.check_plugged()
            if ended:
                break
        return got

    def ready(self, endpoint: int) -> bool:
        """Tell whether data are on their way on ``endpoint``; fetches them from the firmware."""
        self.check_plugged()
        self._check_halt(endpoint)
        if self._moving.get(endpoint):
            return True
        try:
            data = self.firmware.take(endpoint)
        except UsbStall as stall:
            self.halted.add(endpoint)
            raise errors.stalled() from stall
        if data is None:
            return False
        transfers = [InTransfer(data)] if self.tamper is None else list(self.tamper(endpoint, data))
        self._moving[endpoint] = transfers
        return bool(transfers)

    def _move(self, endpoint: d.Endpoint, room: memoryview[int]) -> tuple[int, bool]:
        """Move what fits of the transfer at hand; returns its length and whether it has ended.

        A bulk transfer of whole packets is ended by a zero-length one, an interrupt transfer by its length.
        """
        transfers = self._moving[endpoint.bEndpointAddress]
        packet_size = endpoint.wMaxPacketSize
        data, closed = transfers.pop(0)
        if len(data) <= len(room):
            room[: len(data)] = data
            needs_empty = closed and data and len(data) % packet_size == 0 and _kind(endpoint) == d.BULK
            if needs_empty and len(data) == len(room):
                transfers.insert(0, InTransfer(b""))  # its zero-length packet is left for the next read
            return len(data), closed
        packets = len(room) // packet_size * packet_size
        if packets < len(room):
            raise errors.overflow()
        room[:packets] = data[:packets]
        transfers.insert(0, InTransfer(data[packets:], closed))
        return packets, False

    def _standard(self, setup: Setup) -> bytes:
        kind, index = divmod(setup.value, 256)
        match setup.request_type, setup.request:
            case (0x80, 6):
                try:
                    return self.descriptors.descriptor(kind, index)
                except IndexError as error:
                    raise UsbStall(f"no descriptor {kind}, {index}") from error
            case (0x80, 8):
                return bytes([self.configuration])
            case (0x80 | 0x81, 0):
                return bytes(2)
            case (0x82, 0):
                return bytes([setup.index in self.halted, 0])
            case (0x81, 10):
                return bytes([self.alternates.get(setup.index, 0)])
        raise UsbStall(f"standard request {setup.request:#04x}")

    def _active_interfaces(self) -> tuple[d.Interface, ...]:
        for configuration in self.descriptors.configurations:
            if configuration.bConfigurationValue == self.configuration:
                return configuration.interfaces
        return ()

    def _active_endpoints(self) -> dict[int, d.Endpoint]:
        active = (
            i for i in self._active_interfaces() if i.bAlternateSetting == self.alternates.get(i.bInterfaceNumber, 0)
        )
        return {e.bEndpointAddress: e for e in itertools.chain.from_iterable(i.endpoints for i in active)}

    def _endpoint(self, address: int) -> d.Endpoint:
        self.check_plugged()
        if address not in self._endpoints:
            raise errors.not_found(f"endpoint {address:#04x} in the present setting")
        return self._endpoints[address]

    def _check_halt(self, endpoint: int) -> None:
        if endpoint in self.halted:
            raise errors.stalled()

    def _restart(self) -> None:
        self.alternates.clear()
        self.halted.clear()
        self._moving.clear()
        self._endpoints = self._active_endpoints()

    def _pass_frame(self, length: int = 0, endpoint: d.Endpoint | None = None) -> None:
        """Let the time of a transfer pass: its bytes, up to the end of a frame or polling interval."""
        period_s = self._frame_s
        if endpoint is not None and _kind(endpoint) == d.INTERRUPT:
            high = self.descriptors.speed == d.HIGH_SPEED
            period_s *= 2 ** (endpoint.bInterval - 1) if high else endpoint.bInterval
        now = self.clock.now()
        # The small part forgives the rounding of a clock that stands exactly at the end of a frame.
        frames = math.floor((now + length / self._bytes_per_s) / period_s + 1e-6) + 1
        self.clock.sleep(frames * period_s - now)


def _kind(endpoint: d.Endpoint) -> int:
    return endpoint.bmAttributes & 3
