"""One plugged-in device on the simulated bus: transfers, halts and claims."""

from __future__ import annotations

import itertools
from array import array
from collections.abc import Callable, Iterable
from typing import NamedTuple

from picoradar.drivers.clock import Clock
from picoradar.sim.usb import descriptors as d
from picoradar.sim.usb import errors
from picoradar.sim.usb.firmware import Setup, UsbFirmware, UsbStall
from picoradar.sim.usb.timing import BusTiming, transfer_type

NAK_RETRY_S = 125e-6


class InTransfer(NamedTuple):
    """Data on their way to the host; ``ended`` when a short (or zero-length) packet closes them."""

    data: bytes
    ended: bool = True


class SimUsbDevice:
    """A device from plugging in to unplugging; plugged in again it is a new one, at a new address.

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
        set by injected faults (lost, split, joined or corrupted transfers, missing zero-length packets).
    """

    def __init__(self, firmware: UsbFirmware, clock: Clock, address: int) -> None:
        self.firmware = firmware
        self.descriptors = firmware.descriptors
        self.clock = clock
        self.address = address
        self.plugged = True
        self.configuration = self.descriptors.configurations[0].bConfigurationValue  # as an operating system sets it
        self.alternates: dict[int, int] = {}
        self.claims: dict[int, object] = {}
        self.halted: set[int] = set()
        self.tamper: Callable[[int, bytes], Iterable[InTransfer]] | None = None
        self._moving: dict[int, list[InTransfer]] = {}
        self._timing = BusTiming(clock, self.descriptors.speed)
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
        self._timing.pass_frame()

    def select_alternate(self, interface: int, alternate: int) -> None:
        """Select an alternate setting of an interface.

        Takes no time: garbage collection of a handle may come here, and must not move the clock.
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
        self._timing.pass_frame()

    def clear_halt(self, endpoint: int) -> None:
        """Take an endpoint out of its halt."""
        self._endpoint(endpoint)
        self.halted.discard(endpoint)
        self._moving.pop(endpoint, None)
        self.firmware.halt_cleared(endpoint)
        self._timing.pass_frame()

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a control transfer; its stages take their frames."""
        self.check_plugged()
        self._timing.pass_frame(setup.length)
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
        """Let the time pass that ``data`` take on the bus."""
        self._timing.pass_frame(len(data), self._endpoint(endpoint))

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

        It ends with a short packet, a full buffer or the time limit; data that came before the limit are returned.
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
            self._timing.pass_frame(moved, found)
            self.check_plugged()
            if ended:
                break
        return got

    def ready(self, endpoint: int) -> bool:
        """Get whether data are on their way on ``endpoint``; fetches them from the firmware."""
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
            needs_empty = closed and data and len(data) % packet_size == 0 and transfer_type(endpoint) == d.BULK
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
