"""A pyusb backend for other processes: its bus is a simulated bench that `picoradar.sim.server` serves.

``backend("127.0.0.1:4711")`` makes an object for ``usb.core.find(backend=...)``. Descriptors are fetched once a device;
every transfer is one question and one answer over TCP (`picoradar.sim.usb.frames`). Time limits count in the bench's
time and on the server's side, so that a slow computer does not make the bus late.

A question is a JSON object and bytes: ``{"op": "speed"}``, ``{"op": "enumerate"}``, ``{"op": "open", "device": n}``, or
an operation of pyusb's interface with ``handle`` and ``args`` (a length in place of a buffer), see
`picoradar.sim.server.usb_server`. An answer is ``{"result": ...}`` and bytes, or
``{"error": text, "code": libusb's number, "errno": the system's number}``.
A handle lives as long as its connection.
"""

from __future__ import annotations

import errno
import socket
import threading
from array import array
from dataclasses import dataclass
from typing import cast

import usb.core

from picoradar.sim.usb import errors
from picoradar.sim.usb.described import DescribedBackend
from picoradar.sim.usb.descriptors import Device, device_from_plain
from picoradar.sim.usb.frames import Header, receive_frame, send_frame

PATIENCE_S = 10.0  # wall time that the server may take beyond a transfer's own time limit


def backend(address: str) -> ForwardBackend:
    """Make a pyusb backend that reaches a served bench.

    Parameters
    ----------
    address : str
        ``host:port``, as ``picoradar sim`` reports it.

    Raises
    ------
    OSError
        When nothing listens there.
    ValueError
        When it is not an address.
    """
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit():
        raise ValueError(f"{address!r} is no host:port")
    return ForwardBackend((host, int(port)))


@dataclass(frozen=True)
class RemoteDevice:
    """A device on the served bus: its address there, and its descriptors."""

    address: int
    descriptors: Device


class _Connection:
    """One TCP connection: a question, then its answer."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._socket = socket.create_connection(address, timeout=PATIENCE_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.lock = threading.Lock()

    def ask(self, question: Header, data: bytes, patience_s: float | None) -> tuple[object, bytes]:
        try:
            self._socket.settimeout(patience_s)
            send_frame(self._socket, question, data)
            answer, came = receive_frame(self._socket)
        except OSError as error:  # server gone, or it does not answer
            self.close()
            raise errors.gone() from error
        if "error" in answer:
            kind = usb.core.USBTimeoutError if answer["errno"] == errno.ETIMEDOUT else usb.core.USBError
            raise kind(answer["error"], answer["code"], answer["errno"])
        return answer["result"], came

    def close(self) -> None:
        self._socket.close()


class _Handle:
    """One opening of a device, with its own connection."""

    def __init__(self, connection: _Connection, number: int) -> None:
        self.connection = connection
        self.number = number


class ForwardBackend(DescribedBackend):
    """All that pyusb asks of a bus, forwarded to a served bench.

    Two threads may use it at once: a question that would have to wait for another one takes a connection of its own.

    Parameters
    ----------
    address : tuple of str and int
        Host and port of the server.

    Raises
    ------
    OSError
        When nothing listens there.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        self._address = address
        connection = _Connection(address)
        speed, _ = connection.ask({"op": "speed"}, b"", PATIENCE_S)
        self._speed = cast("float", speed)
        connection.close()

    def enumerate_devices(self) -> list[RemoteDevice]:
        """Get what is plugged in now."""
        connection = self._connect()
        try:
            plugged, _ = connection.ask({"op": "enumerate"}, b"", PATIENCE_S)
        finally:
            connection.close()
        rows = cast("list[Header]", plugged)
        return [RemoteDevice(_number(row["address"]), _device(row["descriptors"])) for row in rows]

    def open_device(self, dev: RemoteDevice) -> _Handle:
        """Open a device."""
        connection = self._connect()
        try:
            number, _ = connection.ask({"op": "open", "device": dev.address}, b"", PATIENCE_S)
        except usb.core.USBError:
            connection.close()
            raise
        return _Handle(connection, _number(number))

    def close_device(self, dev_handle: _Handle) -> None:
        """Close a handle; its claims end. Harmless when called late."""
        dev_handle.connection.close()

    def set_configuration(self, dev_handle: _Handle, config_value: int) -> None:
        """Select a configuration."""
        self._call(dev_handle, "set_configuration", config_value)

    def get_configuration(self, dev_handle: _Handle) -> int:
        """Get the value of the present configuration; 0 means none."""
        return _number(self._call(dev_handle, "get_configuration")[0])

    def set_interface_altsetting(self, dev_handle: _Handle, intf: int, altsetting: int) -> None:
        """Select an alternate setting."""
        self._call(dev_handle, "set_interface_altsetting", int(intf), altsetting)

    def claim_interface(self, dev_handle: _Handle, intf: int) -> None:
        """Take an interface for this handle alone."""
        self._call(dev_handle, "claim_interface", int(intf))

    def release_interface(self, dev_handle: _Handle, intf: int) -> None:
        """Give an interface back; the device returns to alternate setting 0."""
        self._call(dev_handle, "release_interface", int(intf))

    def bulk_write(self, dev_handle: _Handle, ep: int, intf: int, data: array[int], timeout: int) -> int:
        """Write one transfer; returns the bytes taken."""
        args = (ep, int(intf), timeout)
        return _number(self._call(dev_handle, "bulk_write", *args, data=data.tobytes(), timeout_ms=timeout)[0])

    def bulk_read(self, dev_handle: _Handle, ep: int, intf: int, buff: array[int], timeout: int) -> int:
        """Read one transfer into ``buff``; returns its length."""
        _, came = self._call(dev_handle, "bulk_read", ep, int(intf), len(buff), timeout, timeout_ms=timeout)
        memoryview(buff)[: len(came)] = memoryview(came)
        return len(came)

    intr_write = bulk_write
    intr_read = bulk_read

    def ctrl_transfer(
        self,
        dev_handle: _Handle,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: array[int],
        timeout: int,
    ) -> int:
        """Carry out a control transfer; returns the length of its data stage."""
        to_host = bool(bmRequestType & 0x80)
        args = (bmRequestType, bRequest, wValue, wIndex, len(data), timeout)
        sent = b"" if to_host else data.tobytes()
        result, came = self._call(dev_handle, "ctrl_transfer", *args, data=sent, timeout_ms=timeout)
        if to_host:
            memoryview(data)[: len(came)] = memoryview(came)
        return _number(result)

    def clear_halt(self, dev_handle: _Handle, ep: int) -> None:
        """Take an endpoint out of its halt."""
        self._call(dev_handle, "clear_halt", ep)

    def reset_device(self, dev_handle: _Handle) -> None:
        """Reset the port."""
        self._call(dev_handle, "reset_device")

    def _connect(self) -> _Connection:
        try:
            return _Connection(self._address)
        except OSError as error:
            raise errors.gone() from error

    def _call(
        self, handle: _Handle, op: str, *args: int, data: bytes = b"", timeout_ms: int = 1000
    ) -> tuple[object, bytes]:
        question = {"op": op, "handle": handle.number, "args": args}
        patience_s = timeout_ms / 1000 / self._speed + PATIENCE_S if timeout_ms else None  # 0 is for ever to USB
        own = handle.connection
        if own.lock.acquire(blocking=False):
            try:
                return own.ask(question, data, patience_s)
            finally:
                own.lock.release()
        other = self._connect()
        try:
            return other.ask(question, data, patience_s)
        finally:
            other.close()


def _number(result: object) -> int:
    """Get a whole number of an answer; a server that sends something else counts as gone."""
    if not isinstance(result, int):
        raise errors.gone()
    return result


def _device(table: object) -> Device:
    return device_from_plain(cast("Header", table))
