"""MeCom at the wire: frames, check sums, numbers (protocol sheet ``mecom_tec``). Pure functions.

A frame is a control character (``#`` from the host, ``!`` from the device), address (2 hex digits),
sequence number (4), payload, CRC-16/XMODEM over all of that (4), and CR.
"""

from __future__ import annotations

import binascii
import re
import struct
from typing import NamedTuple

END = b"\r"
ANY_ADDRESS = 0x00
ALL_ADDRESSES = 0xFF

_REFUSAL = re.compile(r"\+([0-9A-F]{2})")
_FRAME = re.compile(rb"([#!])([0-9A-F]{2})([0-9A-F]{4})([^#!\x00-\x1F\x7F-\xFF]*)([0-9A-F]{4})\r?\Z")

REFUSALS = {
    0x01: "command not available",
    0x02: "device busy",
    0x03: "general communication error",
    0x04: "format error",
    0x05: "parameter not available",
    0x06: "parameter is read only",
    0x07: "value out of range",
    0x08: "instance not available",
    0x09: "parameter general failure",
}

ERRORS = {
    11: "emergency stop",
    22: "parameter set corrupt",
    23: "parameter set incompatible",
    30: "supply voltage low",
    31: "supply voltage high",
    32: "medium supply low",
    33: "medium supply high",
    36: "3.3 V supply low",
    37: "3.3 V supply high",
    60: "device too hot",
    **dict.fromkeys(range(100, 104), "output over-current"),
    104: "output over-voltage",
    105: "output over-voltage",
    106: "residual current too high",
    107: "total current too high",
    108: "saturation",
    137: "object temperature below threshold",
    138: "object temperature above threshold",
    139: "object temperature changes too fast",
    **dict.fromkeys(range(140, 145), "sink temperature"),
    **dict.fromkeys(range(170, 174), "auto tuning"),
    175: "fan",
    176: "fan",
    182: "temperature not stable in time",
    183: "communication watchdog expired",
}


class Frame(NamedTuple):
    """One parsed frame; ``crc`` is as received and not checked yet, ``own_crc`` is what it should be."""

    control: str
    address: int
    sequence: int
    payload: str
    crc: int
    own_crc: int

    @property
    def is_intact(self) -> bool:
        """Get whether the check sum is the frame's own."""
        return self.crc == self.own_crc

    def acknowledges(self, command_crc: int) -> bool:
        """Get whether this is the answer to a set command: no payload, and the *command's* check sum."""
        return not self.payload and self.crc == command_crc

    @property
    def refusal(self) -> int | None:
        """Get the code of a refusal (``+`` and two hex digits); None for any other answer."""
        match = _REFUSAL.fullmatch(self.payload)
        return int(match[1], 16) if match else None


def crc16(data: bytes) -> int:
    """Compute the CRC-16/XMODEM (polynomial 0x1021, start 0, not reflected) of ``data``."""
    return binascii.crc_hqx(data, 0)


def encode(control: str, address: int, sequence: int, payload: str, *, crc: int | None = None) -> bytes:
    """Make the bytes of one frame; ``crc`` in place of its own makes an acknowledgement."""
    body = f"{control}{address:02X}{sequence:04X}{payload}".encode("ascii")
    return body + f"{crc16(body) if crc is None else crc:04X}".encode("ascii") + END


def decode(line: bytes) -> Frame:
    """Parse one frame.

    A control character starts a new frame, so everything before the last one is dropped.

    Raises
    ------
    ValueError
        When the line holds no frame, or one with other than capital hex digits.
    """
    match = _FRAME.search(line)
    if match is None:
        raise ValueError(f"{line!r} is no frame")
    control, address, sequence, payload, crc = match.groups()
    own_crc = crc16(line[match.start() : match.start(5)])
    return Frame(control.decode(), int(address, 16), int(sequence, 16), payload.decode(), int(crc, 16), own_crc)


def encode_float(value: float) -> str:
    """Write a FLOAT32: 23.0 is ``41B80000``."""
    return struct.pack(">f", value).hex().upper()


def decode_float(digits: str) -> float:
    """Read a FLOAT32 from its eight hex digits.

    Raises
    ------
    ValueError
        When they are not eight capital hex digits.
    """
    return float(struct.unpack(">f", _four_bytes(digits))[0])


def encode_int(value: int) -> str:
    """Write an INT32 in two's complement, high digit first."""
    return struct.pack(">i", value).hex().upper()


def decode_int(digits: str) -> int:
    """Read an INT32 from its eight hex digits.

    Raises
    ------
    ValueError
        When they are not eight capital hex digits.
    """
    return int(struct.unpack(">i", _four_bytes(digits))[0])


def _four_bytes(digits: str) -> bytes:
    if len(digits) != 8 or digits.strip("0123456789ABCDEF"):
        raise ValueError(f"{digits!r} are not eight capital hex digits")
    return bytes.fromhex(digits)
