"""USB devices of the bench for other processes: the server's end of `picoradar.sim.usb.forward`."""

from __future__ import annotations

import itertools
import socket
from collections.abc import Callable
from dataclasses import asdict

import usb.core

from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.listener import LOOPBACK, Listener
from picoradar.sim.server.usb_operations import Answer, are_arguments, control, read, refused, writer
from picoradar.sim.usb import (
    BadFrame,
    Header,
    SimUsbBackend,
    SimUsbDevice,
    UsbHandle,
    errors,
    send_frame,
    take_frame,
)

SEND_LIMIT_S = 1.0  # a host that does not accept its answer within this time is dropped


class UsbServer:
    """Answers the questions of any number of hosts.

    Parameters
    ----------
    backend : SimUsbBackend
        The bus.
    loop : EventLoop
        Tells when a question comes; its clock is that of the bus.
    """

    def __init__(self, backend: SimUsbBackend, loop: EventLoop) -> None:
        self.backend = backend
        self.loop = loop
        self.handles: dict[int, UsbHandle] = {}
        self.numbers = itertools.count(1)
        self._hosts: list[_Host] = []
        self._listener = Listener(loop, self._accept)
        loop.every_turn(self._go_on)

    @property
    def address(self) -> str:
        """Get the argument of `picoradar.sim.usb.forward.backend`."""
        return f"{LOOPBACK}:{self._listener.port}"

    def close(self) -> None:
        """Drop all hosts and listen no more."""
        for host in list(self._hosts):
            self.drop(host)
        self._listener.close()
        self.loop.no_more(self._go_on)

    def drop(self, host: _Host) -> None:
        """Forget a host; its handles and their claims end."""
        self._hosts.remove(host)
        host.close()

    def enumerate(self) -> list[Header]:
        """Describe what is plugged in."""
        plugged = self.backend.enumerate_devices()
        return [{"address": d.address, "descriptors": asdict(d.descriptors)} for d in plugged]

    def device(self, address: object) -> SimUsbDevice:
        """Get a device by its address; addresses are never used twice.

        Raises
        ------
        usb.core.USBError
            ENODEV when it is not plugged in, or no longer.
        """
        for device in self.backend.enumerate_devices():
            if device.address == address:
                return device
        raise errors.gone()

    def _accept(self, connection: socket.socket) -> None:
        connection.settimeout(SEND_LIMIT_S)
        self._hosts.append(_Host(self, connection))

    def _go_on(self) -> None:
        for host in list(self._hosts):
            host.go_on()


class _Host:
    """One connection: a question at a time, which may take a while to be answered."""

    def __init__(self, server: UsbServer, connection: socket.socket) -> None:
        self._server = server
        self._connection = connection
        self._received = bytearray()
        self._opened: list[int] = []
        self._pending: Callable[[], Answer | None] | None = None
        server.loop.watch(connection, self._hear)

    def close(self) -> None:
        self._server.loop.forget(self._connection)
        self._connection.close()
        for number in self._opened:
            self._server.backend.close_device(self._server.handles.pop(number))
        self._pending = None

    def go_on(self) -> None:
        """Repeat an attempt that had no answer yet."""
        if self._pending is None:
            return
        try:
            answer = self._pending()
        except usb.core.USBError as error:
            answer = None
            self._pending = None
            self._send({"error": error.strerror or str(error), "code": error.backend_error_code, "errno": error.errno})
        if answer is not None:
            self._pending = None
            self._send({"result": answer[0]}, answer[1])

    def _hear(self) -> None:
        try:
            came = self._connection.recv(1 << 16)
            self._received += came
            question = take_frame(self._received) if came else None
        except (OSError, BadFrame):
            came, question = b"", None
        waiting = question is not None and (self._pending is not None or self._received)
        if not came or waiting:  # one question at a time: else they would pile up here unread
            self._server.drop(self)
        elif question is not None:
            self._pending = self._asked(*question)
            self.go_on()

    def _send(self, header: Header, data: bytes = b"") -> None:
        self._server.loop.catch_up()  # the transfer has taken its time
        try:
            send_frame(self._connection, header, data)
        except OSError:
            self._server.drop(self)

    def _asked(self, question: Header, data: bytes) -> Callable[[], Answer | None]:
        """Make the function that answers a question; it is called again until it returns an answer."""
        op, args = question.get("op"), question.get("args", [])
        server, backend = self._server, self._server.backend
        match op:
            case "speed":
                return lambda: (server.loop.speed, b"")
            case "enumerate":
                return lambda: (server.enumerate(), b"")
            case "open":
                return lambda: (self._open(question.get("device")), b"")
        number = question.get("handle")
        handle = server.handles.get(number) if isinstance(number, int) else None
        if handle is None or not isinstance(op, str) or not are_arguments(args, op):
            return lambda: refused(question)
        match op:
            case "bulk_read":
                endpoint, interface, length, timeout_ms = args
                return self._patiently(lambda: read(backend, handle, endpoint, interface, length), timeout_ms)
            case "bulk_write":
                endpoint, interface, timeout_ms = args
                return self._patiently(writer(backend, handle, endpoint, interface, data), timeout_ms)
            case "ctrl_transfer":
                return lambda: control(backend, handle, args, data)
        return lambda: (getattr(backend, op)(handle, *args), b"")

    def _open(self, device: object) -> int:
        number = next(self._server.numbers)
        self._server.handles[number] = self._server.backend.open_device(self._server.device(device))
        self._opened.append(number)
        return number

    def _patiently(self, attempt: Callable[[], Answer], timeout_ms: int) -> Callable[[], Answer | None]:
        """Make an attempt that is repeated in every turn until its time limit (0: without end)."""
        clock = self._server.loop.clock
        limit = clock.now() + timeout_ms / 1000 if timeout_ms else float("inf")
        if timeout_ms:
            clock.call_at(limit, _nothing)  # a turn then

        def attempted() -> Answer | None:
            try:
                return attempt()
            except usb.core.USBTimeoutError:
                if clock.now() >= limit:
                    raise
                return None

        return attempted


def _nothing() -> None:
    pass
