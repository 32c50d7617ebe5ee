# ruff: noqa: ARG002 (the arguments are those of the UsbFirmware protocol)
"""USBTMC interface (USB488) of simulated instruments: bulk messages, abort and clear, status byte.

Source: protocol sheet ``usbtmc.md``. A request that has not been answered keeps bulk OUT busy: a host that gives up
without the abort sequence finds that everything after it times out.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

from picoradar.drivers.links import BadHeader, Capabilities, ControlRequest, Header, MsgId, TmcStatus
from picoradar.drivers.links import usbtmc_wire as wire
from picoradar.sim.usb import BULK, INTERRUPT, Configuration, Device, Endpoint, Interface, Setup, UsbStall

EP_OUT = 0x02
EP_IN = 0x81
EP_INTERRUPT = 0x83
PACKET = 512
MESSAGE_MAX = 1 << 20
CAPABILITIES = Capabilities(0x00, 0x01, 0x07, 0x0F)
_TERM_CHAR_ENABLED = 2


class Instrument(Protocol):
    """What is behind the interface."""

    output: bytes | None

    @property
    def status_byte(self) -> int:
        """Get the IEEE 488 status byte."""

    def execute(self, message: bytes) -> None:
        """Take a whole program message."""

    def trigger(self) -> None:
        """Carry out a TRIGGER message."""

    def clear(self) -> None:
        """Carry out a device clear."""


def tmc_descriptors(vendor_id: int, product_id: int, strings: tuple[str, str, str]) -> Device:
    """Make the descriptors of a USB488 instrument with manufacturer, product and serial number."""
    endpoints = (Endpoint(EP_OUT, BULK, PACKET), Endpoint(EP_IN, BULK, PACKET), Endpoint(EP_INTERRUPT, INTERRUPT, 2, 4))
    interface = Interface(endpoints, 0, 0, *wire.INTERFACE_CLASS)
    return Device(
        vendor_id,
        product_id,
        0x0100,
        (Configuration((interface,), bmAttributes=0xC0, bMaxPower=0),),
        strings=strings,
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=3,
    )


class UsbtmcFirmware:
    """USB488 interface in front of an instrument.

    Parameters
    ----------
    instrument : Instrument
    descriptors : Device
    """

    def __init__(self, instrument: Instrument, descriptors: Device) -> None:
        self.descriptors = descriptors
        self.instrument = instrument
        self._incoming = b""
        self._message = b""
        self._request: Header | None = None
        self._short_packet = False
        self._asked_again = False
        self._sent = 0
        self._notices: deque[bytes] = deque(maxlen=8)
        self._service_requested = False

    def receive(self, endpoint: int, data: bytes) -> bool:
        """Take (a part of) a transfer on bulk OUT; busy while a request is not answered."""
        if self._request is not None or self._short_packet:
            return False
        self._incoming += data
        ended = len(data) % PACKET != 0 or not data
        try:
            header = Header.decode(self._incoming)
        except BadHeader as error:
            self._incoming = b""
            raise UsbStall(str(error)) from error
        whole = wire.HEADER + (header.size if header.msg_id == MsgId.DEV_DEP_MSG_OUT else 0)
        if len(self._incoming) < whole and not ended:
            return True
        body, self._incoming = self._incoming[wire.HEADER : whole], b""
        if wire.HEADER + len(body) < whole or len(self._message) + len(body) > MESSAGE_MAX:
            self._message = b""
            raise UsbStall(f"{len(body)} bytes came, the header says {header.size}")
        self._carry_out(header, body)
        return True

    def take(self, endpoint: int) -> bytes | None:
        """Give the answer to the request that waits, or a notice on the interrupt endpoint."""
        if endpoint == EP_INTERRUPT:
            self._check_service()
            return self._notices.popleft() if self._notices else None
        if self._short_packet:
            self._short_packet = False
            return b""
        output = self.instrument.output
        if self._request is None or output is None:
            return None
        request, self._request = self._request, None
        part = output[: request.size]
        ended_by_char = False
        if request.attributes & _TERM_CHAR_ENABLED and (at := part.find(request.term_char)) >= 0:
            part, ended_by_char = part[: at + 1], True
        rest = output[len(part) :]
        self.instrument.output = rest or None
        self._sent = len(part)
        attributes = (0 if rest else 1) | (_TERM_CHAR_ENABLED if ended_by_char else 0)
        return wire.encode_answer(request.tag, part, attributes=attributes)

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a class request."""
        tag = setup.value & 0xFF
        match (setup.request_type, setup.request):
            case (wire.CLASS_TO_ENDPOINT, ControlRequest.INITIATE_ABORT_BULK_OUT):
                found = bool(self._incoming or self._message)
                self._incoming = self._message = b""
                return bytes([TmcStatus.SUCCESS if found else TmcStatus.TRANSFER_NOT_IN_PROGRESS, tag])
            case (wire.CLASS_TO_ENDPOINT, ControlRequest.CHECK_ABORT_BULK_OUT_STATUS):
                return bytes([TmcStatus.SUCCESS, 0, 0, 0]) + bytes(4)
            case (wire.CLASS_TO_ENDPOINT, ControlRequest.INITIATE_ABORT_BULK_IN):
                return bytes([self._abort_in(tag), tag])
            case (wire.CLASS_TO_ENDPOINT, ControlRequest.CHECK_ABORT_BULK_IN_STATUS):
                pending = self._short_packet and not self._asked_again
                if self._short_packet and self._asked_again:
                    self._short_packet = False  # a host that never empties bulk IN must not poll without end
                self._asked_again = pending
                status = TmcStatus.PENDING if pending else TmcStatus.SUCCESS
                return bytes([status, pending, 0, 0]) + self._sent.to_bytes(4, "little")
            case (wire.CLASS_TO_INTERFACE, ControlRequest.INITIATE_CLEAR):
                self._clear()
                return bytes([TmcStatus.SUCCESS])
            case (wire.CLASS_TO_INTERFACE, ControlRequest.CHECK_CLEAR_STATUS):
                return bytes([TmcStatus.SUCCESS, 0])
            case (wire.CLASS_TO_INTERFACE, ControlRequest.GET_CAPABILITIES):
                return CAPABILITIES.encode()
            case (wire.CLASS_TO_INTERFACE, ControlRequest.READ_STATUS_BYTE):
                if not 2 <= tag <= 127:
                    return bytes([TmcStatus.FAILED, tag, 0])
                self._notices.append(bytes([0x80 | tag, self.instrument.status_byte]))
                return bytes([TmcStatus.SUCCESS, tag, 0])
            case (
                wire.CLASS_TO_INTERFACE,
                ControlRequest.INDICATOR_PULSE
                | ControlRequest.REN_CONTROL
                | ControlRequest.GO_TO_LOCAL
                | ControlRequest.LOCAL_LOCKOUT,
            ):
                return bytes([TmcStatus.SUCCESS])
        raise UsbStall(f"request {setup.request} of type {setup.request_type:#04x}")

    def configured(self, value: int) -> None:
        """Clear both buffers."""
        self._clear()

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """There is one alternate setting only."""

    def halt_cleared(self, endpoint: int) -> None:
        """Forget a half-received message."""
        if endpoint == EP_OUT:
            self._incoming = self._message = b""

    def bus_reset(self) -> None:
        """Clear both buffers."""
        self._clear()

    def _carry_out(self, header: Header, body: bytes) -> None:
        match header.msg_id:
            case MsgId.DEV_DEP_MSG_OUT:
                self._message += body
                if header.end_of_message:
                    message, self._message = self._message, b""
                    self.instrument.execute(message)
            case MsgId.DEV_DEP_MSG_IN:
                if header.size == 0:
                    raise UsbStall("request for no bytes")
                self._request = header
            case MsgId.TRIGGER:
                self.instrument.trigger()
            case _:
                raise UsbStall(f"MsgID {header.msg_id}")

    def _abort_in(self, tag: int) -> TmcStatus:
        if self._request is None or self._request.tag != tag:
            return TmcStatus.TRANSFER_NOT_IN_PROGRESS
        self._request = None
        self._short_packet = True
        self._asked_again = False
        self._sent = 0
        return TmcStatus.SUCCESS

    def _clear(self) -> None:
        self._incoming = self._message = b""
        self._request = None
        self._short_packet = False
        self.instrument.clear()

    def _check_service(self) -> None:
        """Send one request for service each time its condition arises."""
        status = self.instrument.status_byte
        requested = bool(status & 0x40)
        if requested and not self._service_requested:
            self._notices.append(bytes([0x81, status]))
        self._service_requested = requested
