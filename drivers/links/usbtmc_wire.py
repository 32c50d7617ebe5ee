"""USBTMC and its USB488 subclass at the wire: headers of the bulk messages and control requests as pure data.

Source: protocol sheet ``usbtmc.md``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

INTERFACE_CLASS = (0xFE, 0x03, 0x01)
HEADER = 12
CLASS_TO_INTERFACE = 0xA1
CLASS_TO_ENDPOINT = 0xA2

_REQUEST = struct.Struct("<BBBxIBB2x")


class MsgId(IntEnum):
    """MsgID of a bulk message; 2 is both the request on bulk OUT and the answer on bulk IN."""

    DEV_DEP_MSG_OUT = 1
    DEV_DEP_MSG_IN = 2
    VENDOR_OUT = 126
    VENDOR_IN = 127
    TRIGGER = 128


class ControlRequest(IntEnum):
    """bRequest of the class requests."""

    INITIATE_ABORT_BULK_OUT = 1
    CHECK_ABORT_BULK_OUT_STATUS = 2
    INITIATE_ABORT_BULK_IN = 3
    CHECK_ABORT_BULK_IN_STATUS = 4
    INITIATE_CLEAR = 5
    CHECK_CLEAR_STATUS = 6
    GET_CAPABILITIES = 7
    INDICATOR_PULSE = 64
    READ_STATUS_BYTE = 128
    REN_CONTROL = 160
    GO_TO_LOCAL = 161
    LOCAL_LOCKOUT = 162


class TmcStatus(IntEnum):
    """First byte of the answers to the class requests."""

    SUCCESS = 0x01
    PENDING = 0x02
    INTERRUPT_IN_BUSY = 0x20
    FAILED = 0x80
    TRANSFER_NOT_IN_PROGRESS = 0x81
    SPLIT_NOT_IN_PROGRESS = 0x82
    SPLIT_IN_PROGRESS = 0x83


class BadHeader(ValueError):
    """Bytes that are not a USBTMC header, or not the expected one."""


@dataclass(frozen=True)
class Header:
    """Header of a bulk message.

    Attributes
    ----------
    msg_id, tag : int
        MsgID, and bTag (1 to 255).
    size : int
        Data bytes that follow or, in a request, the largest number wanted.
    attributes : int
        Bit 0: end of message. In a request, bit 1: end at the TermChar.
    term_char : int
    """

    msg_id: int
    tag: int
    size: int = 0
    attributes: int = 0
    term_char: int = 0

    @property
    def end_of_message(self) -> bool:
        """Get whether the message ends with these data."""
        return bool(self.attributes & 1)

    def encode(self) -> bytes:
        """Get the 12 bytes."""
        return _REQUEST.pack(self.msg_id, self.tag, self.tag ^ 0xFF, self.size, self.attributes, self.term_char)

    @classmethod
    def decode(cls, data: bytes) -> Header:
        """Read the header at the beginning of ``data``.

        Raises
        ------
        BadHeader
            When it is too short, or its tag and complement contradict each other.
        """
        if len(data) < HEADER:
            raise BadHeader(f"{len(data)} bytes are no header: {data.hex(' ')}")
        msg_id, tag, complement, size, attributes, term_char = _REQUEST.unpack_from(data)
        if tag == 0 or complement != tag ^ 0xFF:
            raise BadHeader(f"tag {tag:#04x} and complement {complement:#04x} contradict each other")
        return cls(msg_id, tag, size, attributes, term_char)


def padded(data: bytes) -> bytes:
    """Fill up to a multiple of 4 bytes; the padding is not counted in the header."""
    return data + bytes(-len(data) % 4)


def encode_message(tag: int, data: bytes, *, end: bool = True) -> bytes:
    """Get a DEV_DEP_MSG_OUT transfer: header, data, padding."""
    return Header(MsgId.DEV_DEP_MSG_OUT, tag, len(data), int(end)).encode() + padded(data)


def encode_request(tag: int, size: int) -> bytes:
    """Get a REQUEST_DEV_DEP_MSG_IN for up to ``size`` bytes."""
    return Header(MsgId.DEV_DEP_MSG_IN, tag, size).encode()


def encode_answer(tag: int, data: bytes, *, attributes: int) -> bytes:
    """Get a DEV_DEP_MSG_IN transfer, as a device sends it."""
    return Header(MsgId.DEV_DEP_MSG_IN, tag, len(data), attributes).encode() + padded(data)


def decode_answer(transfer: bytes, tag: int) -> tuple[bytes, bool]:
    """Read a DEV_DEP_MSG_IN transfer.

    Parameters
    ----------
    transfer : bytes
        With its header.
    tag : int
        bTag of the request.

    Returns
    -------
    data : bytes
    end : bool
        Whether the message ends with them.

    Raises
    ------
    BadHeader
        When it answers another request, or its length differs from its header.
    """
    header = Header.decode(transfer)
    if header.msg_id != MsgId.DEV_DEP_MSG_IN or header.tag != tag:
        raise BadHeader(f"MsgID {header.msg_id}, tag {header.tag} came, an answer to tag {tag} was expected")
    data = transfer[HEADER : HEADER + header.size]
    if len(data) != header.size or len(transfer) > HEADER + len(padded(data)):
        raise BadHeader(f"header says {header.size} bytes, the transfer has {len(transfer) - HEADER}")
    return data, header.end_of_message


def next_tag(tag: int) -> int:
    """Get the tag after ``tag``: 1 to 255, never 0."""
    return tag % 255 + 1


@dataclass(frozen=True)
class Capabilities:
    """What an instrument can do (GET_CAPABILITIES); bits in the order of the Linux driver.

    Attributes
    ----------
    interface, device, interface_488, device_488 : int
        Bytes 4, 5, 14 and 15 of the answer.
    """

    interface: int
    device: int
    interface_488: int
    device_488: int

    def encode(self) -> bytes:
        """Get the 24 bytes of the answer."""
        answer = bytearray(24)
        answer[0] = TmcStatus.SUCCESS
        answer[3] = answer[13] = 0x01  # versions 1.00 of USBTMC and USB488
        answer[4:6] = self.interface, self.device
        answer[14:16] = self.interface_488, self.device_488
        return bytes(answer)

    @classmethod
    def decode(cls, answer: bytes) -> Capabilities:
        """Read the answer.

        Raises
        ------
        BadHeader
            When it is too short or reports a failure.
        """
        if len(answer) < 24 or answer[0] != TmcStatus.SUCCESS:
            raise BadHeader(f"no capabilities: {answer.hex(' ')}")
        return cls(answer[4], answer[5], answer[14], answer[15])

    @property
    def trigger(self) -> bool:
        """Get whether the TRIGGER message is understood."""
        return bool(self.interface_488 & 1)

    @property
    def remote_control(self) -> bool:
        """Get whether REN_CONTROL, GO_TO_LOCAL and LOCAL_LOCKOUT are understood."""
        return bool(self.interface_488 & 2)
