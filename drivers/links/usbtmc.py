"""USBTMC: messages to and from an instrument, with the abort and clear sequences that a timeout needs.

Source: protocol sheet ``usbtmc.md``. After a timeout the instrument still owes an answer; without the abort sequence
every later query would time out as well.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from picoradar.drivers.errors import DeviceError, ProtocolError, Stall, Timeout
from picoradar.drivers.links import usbtmc_wire as wire
from picoradar.drivers.links.usb import UsbLink
from picoradar.drivers.links.usbtmc_wire import BadHeader, Capabilities, ControlRequest, TmcStatus

CHUNK = 16_384  # largest amount of data asked for in one request
LIMIT = 4 << 20  # longest answer that is accepted
POLL_S = 0.01
POLLS = 50


class Usbtmc:
    """Messages over one link.

    Parameters
    ----------
    link : UsbLink
        To an interface of class 0xFE, subclass 3.
    bulk_out, bulk_in : int
        Addresses of the bulk endpoints.
    interrupt_in : int, optional
        Address of the interrupt endpoint, if there is one: the status byte comes there.
    packet : int
        Size of a bulk packet.
    timeout_s : float
        Limit of a write or an answer.
    """

    def __init__(
        self,
        link: UsbLink,
        *,
        bulk_out: int = 0x02,
        bulk_in: int = 0x81,
        interrupt_in: int | None = None,
        packet: int = 512,
        timeout_s: float = 2.0,
    ) -> None:
        self.link = link
        self.bulk_out = bulk_out
        self.bulk_in = bulk_in
        self.interrupt_in = interrupt_in
        self.packet = packet
        self.timeout_s = timeout_s
        self.capabilities = Capabilities(0, 0, 0, 0)
        self._tag = 0

    def open(self) -> None:
        """Open the link, clear both buffers and read the capabilities."""
        self.link.open()
        self.clear()
        try:
            answer = self._control(ControlRequest.GET_CAPABILITIES, 24)
            self.capabilities = Capabilities.decode(answer)
        except BadHeader as error:
            raise ProtocolError(self.link.device, str(error)) from error

    def close(self) -> None:
        """Release the device."""
        self.link.close()

    def write(self, message: bytes, *, timeout_s: float | None = None) -> None:
        """Send a message.

        Raises
        ------
        Timeout
            When the instrument does not take it; the transfer was aborted.
        """
        tag = self._next_tag()
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        try:
            self.link.write(self.bulk_out, wire.encode_message(tag, message), timeout_s=limit_s)
        except Timeout:
            self._recover(lambda: self._abort_out(tag))
            raise
        except Stall:
            self.link.clear_halt(self.bulk_out)
            raise

    def read(self, *, timeout_s: float | None = None) -> bytes:
        """Read a message, in as many parts as the instrument splits it into.

        Raises
        ------
        Timeout
            When no answer comes within the limit; the request was aborted, so that the next query is answered.
        ProtocolError
            When the answer belongs to another request, or is longer than 4 MiB; both buffers were cleared.
        """
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        message = b""
        ended = False
        while not ended:
            part, ended = self._read_part(limit_s)
            message += part
            if len(message) > LIMIT:
                self._recover(self.clear)
                raise ProtocolError(self.link.device, f"answer is longer than {LIMIT} bytes")
        return message

    def query(self, message: bytes, *, timeout_s: float | None = None) -> bytes:
        """Send a message and read the answer."""
        self.write(message)
        return self.read(timeout_s=timeout_s)

    def clear(self) -> None:
        """Empty both buffers of the instrument and abort its present operation (device clear).

        Raises
        ------
        ProtocolError
            When the instrument does not finish it.
        """
        self._control(ControlRequest.INITIATE_CLEAR, 1)
        for _ in range(POLLS):
            answer = self.link.control_in(ControlRequest.CHECK_CLEAR_STATUS, 0, 2, kind=wire.CLASS_TO_INTERFACE)
            status, flags = self._status(answer, 2)
            if status == TmcStatus.SUCCESS:
                self.link.clear_halt(self.bulk_out)
                return
            if flags & 1:
                self._drain()
            self.link.clock.sleep(POLL_S)
        raise ProtocolError(self.link.device, "device clear was not finished", "switch the instrument off and on")

    def status_byte(self) -> int:
        """Get the IEEE 488 status byte.

        Raises
        ------
        Timeout
            When it does not come on the interrupt endpoint.
        """
        tag = 2 + self._next_tag() % 126
        control = self.link.control_in(ControlRequest.READ_STATUS_BYTE, tag, 3, kind=wire.CLASS_TO_INTERFACE)
        answer = self._status(control, 3)
        if self.interrupt_in is None:
            return answer[2]
        while True:
            notice = self.link.read(self.interrupt_in, 2, timeout_s=self.timeout_s)
            if notice[:1] == bytes([0x80 | tag]):  # others are requests for service
                return notice[1]

    def trigger(self) -> None:
        """Send the TRIGGER message.

        Raises
        ------
        ProtocolError
            When the instrument does not know it.
        """
        if not self.capabilities.trigger:
            raise ProtocolError(self.link.device, "does not know the TRIGGER message")
        header = wire.Header(wire.MsgId.TRIGGER, self._next_tag()).encode()
        self.link.write(self.bulk_out, header, timeout_s=self.timeout_s)

    def _read_part(self, limit_s: float) -> tuple[bytes, bool]:
        tag = self._next_tag()
        self.link.write(self.bulk_out, wire.encode_request(tag, CHUNK), timeout_s=self.timeout_s)
        try:
            transfer = self.link.read(self.bulk_in, self._buffer, timeout_s=limit_s)
        except Timeout:
            self._recover(lambda: self._abort_in(tag))
            raise
        except Stall:
            self.link.clear_halt(self.bulk_in)
            raise
        try:
            return wire.decode_answer(transfer, tag)
        except BadHeader as error:
            self._recover(self.clear)
            raise ProtocolError(self.link.device, f"answer: {error}") from error

    @property
    def _buffer(self) -> int:
        return ((wire.HEADER + CHUNK) // self.packet + 1) * self.packet

    @staticmethod
    def _recover(sequence: Callable[[], None]) -> None:
        """Carry out an abort sequence after an error; only the first error is reported."""
        with contextlib.suppress(DeviceError):
            sequence()

    def _abort_in(self, tag: int) -> None:
        """Abort an answer: initiate, read bulk IN until a short packet, check; device clear if that fails."""
        if self._abort(ControlRequest.INITIATE_ABORT_BULK_IN, tag, self.bulk_in) != TmcStatus.SUCCESS:
            self.clear()
            return
        for _ in range(POLLS):
            self._drain()
            status, *_ = self._status(self._check(ControlRequest.CHECK_ABORT_BULK_IN_STATUS, self.bulk_in), 8)
            if status == TmcStatus.SUCCESS:
                return
            self.link.clock.sleep(POLL_S)
        self.clear()

    def _abort_out(self, tag: int) -> None:
        """Abort a message: initiate, check, clear the halt; device clear if that fails."""
        if self._abort(ControlRequest.INITIATE_ABORT_BULK_OUT, tag, self.bulk_out) != TmcStatus.SUCCESS:
            self.clear()
            return
        for _ in range(POLLS):
            status, *_ = self._status(self._check(ControlRequest.CHECK_ABORT_BULK_OUT_STATUS, self.bulk_out), 8)
            if status == TmcStatus.SUCCESS:
                self.link.clear_halt(self.bulk_out)
                return
            self.link.clock.sleep(POLL_S)
        self.clear()

    def _abort(self, request: ControlRequest, tag: int, endpoint: int) -> int:
        return self.link.control_in(request, tag, 2, kind=wire.CLASS_TO_ENDPOINT, index=endpoint)[0]

    def _check(self, request: ControlRequest, endpoint: int) -> bytes:
        return self.link.control_in(request, 0, 8, kind=wire.CLASS_TO_ENDPOINT, index=endpoint)

    def _drain(self) -> None:
        """Read bulk IN until a short packet, or until nothing comes."""
        with contextlib.suppress(Timeout):
            while len(self.link.read(self.bulk_in, self._buffer, timeout_s=POLL_S)) == self._buffer:
                pass

    def _control(self, request: ControlRequest, length: int) -> bytes:
        answer = self.link.control_in(request, 0, length, kind=wire.CLASS_TO_INTERFACE)
        status, *_ = self._status(answer, length)
        if status != TmcStatus.SUCCESS:
            raise ProtocolError(self.link.device, f"{request.name} answered with status {status:#04x}")
        return answer

    def _status(self, answer: bytes, length: int) -> bytes:
        if len(answer) < length:
            raise ProtocolError(self.link.device, f"control answer {answer.hex(' ')} is shorter than {length} bytes")
        if answer[0] >= TmcStatus.FAILED:
            raise ProtocolError(self.link.device, f"control request failed with status {answer[0]:#04x}")
        return answer[:length]

    def _next_tag(self) -> int:
        self._tag = wire.next_tag(self._tag)
        return self._tag
