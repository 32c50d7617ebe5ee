"""TDK-Lambda Genesys at the wire: messages, check sums, registers (protocol sheet ``tdk_genesys``). Pure functions.

A message ends with CR and gets one reply. A check sum is optional: ``$`` and two hex digits, the low byte
of the sum of the ASCII codes before it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import IntEnum, IntFlag

END = b"\r"

ERRORS = {
    "E01": "voltage above the range (105 % of the rating, or 95 % of the over-voltage trip)",
    "E02": "voltage below the under-voltage limit",
    "E04": "over-voltage trip too low for the voltage that is set",
    "E06": "under-voltage limit above the voltage that is set",
    "E07": "output refused while a fault shuts it down",
    "C01": "illegal command or query",
    "C02": "parameter missing",
    "C03": "illegal parameter",
    "C04": "check sum",
    "C05": "setting out of range",
}

_STT = re.compile(r"MV\((.+)\),PV\((.+)\),MC\((.+)\),PC\((.+)\),SR\(([0-9A-F]{2})\),FR\(([0-9A-F]{2})\)")
_MODEL = re.compile(r"G(?:EN)?H?(\d+)-(\d+(?:\.\d+)?)")


class Fault(IntFlag):
    """Bits of ``FLT?`` and ``FEVE?``."""

    AC_FAIL = 0x02
    OVER_TEMPERATURE = 0x04
    FOLDBACK = 0x08
    OVER_VOLTAGE = 0x10
    SHUT_OFF = 0x20
    PANEL_OFF = 0x40
    INTERLOCK = 0x80


class Status(IntFlag):
    """Bits of ``STAT?`` and ``SEVE?``.

    `NO_FAULT`: no fault that ``FENA`` enables is there now. `FAULT`: the event register FEVE holds one. With
    ``FENA 00`` neither tells of a fault, so for safety read ``FLT?``.
    """

    CONSTANT_VOLTAGE = 0x01
    CONSTANT_CURRENT = 0x02
    NO_FAULT = 0x04
    FAULT = 0x08
    AUTO_START = 0x10
    FOLDBACK_ENABLED = 0x20
    LOCAL = 0x80


class Filter(IntEnum):
    """Measuring filters (``FILTER``), in Hz."""

    HZ_18 = 18
    HZ_23 = 23
    HZ_46 = 46


class Remote(IntEnum):
    """Who may operate the supply (``RMT``): the panel, the host and the panel's key, the host alone."""

    LOC = 0
    REM = 1
    LLO = 2


@dataclass(frozen=True)
class SupplyState:
    """One reply to ``STT?``: set points, measured values and both registers."""

    measured_v: float
    voltage_v: float
    measured_a: float
    current_a: float
    status: Status
    fault: Fault


def checksum(text: str) -> str:
    """Get the two hex digits for ``text``: low byte of the sum of its ASCII codes."""
    return f"{sum(text.encode('ascii')) & 0xFF:02X}"


def encode(text: str, *, with_checksum: bool = False) -> bytes:
    """Make the bytes of one message."""
    return (f"{text}${checksum(text)}" if with_checksum else text).encode("ascii") + END


def decode(line: bytes, *, with_checksum: bool = False) -> str:
    """Get the text of one reply.

    Parameters
    ----------
    line : bytes
        With or without its end.
    with_checksum : bool
        Whether a check sum is due; one that is there is checked in any case.

    Raises
    ------
    ValueError
        When it is no ASCII text, or a check sum is wrong or missing where one is due.
    """
    text = line.decode("ascii").strip("\r\n")
    if not text.isprintable():
        raise ValueError(f"control characters in {line!r}")
    if "$" not in text:
        if with_checksum:
            raise ValueError(f"no check sum in {line!r}")
        return text
    body, _, digits = text.rpartition("$")
    if digits.upper() != checksum(body):
        raise ValueError(f"check sum of {line!r} should be {checksum(body)}")
    return body


def unsolicited_from(text: str) -> int | None:
    """Get the address in an unsolicited message ``!nn``; None for any other text."""
    match = re.fullmatch(r"!(\d\d)", text)
    return int(match[1]) if match else None


def format_number(value: float) -> str:
    """Write a number in at most 12 characters: ``290``, ``0.1``."""
    return f"{value:.6f}".rstrip("0").rstrip(".")


def parse_state(text: str) -> SupplyState:
    """Read the reply to ``STT?``.

    Raises
    ------
    ValueError
        When it is none.
    """
    match = _STT.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is no reply to STT?")
    measured_v, voltage_v, measured_a, current_a = (float(part) for part in match.groups()[:4])
    return SupplyState(
        measured_v, voltage_v, measured_a, current_a, Status(int(match[5], 16)), Fault(int(match[6], 16))
    )


def parse_rating(model: str) -> tuple[float, float]:
    """Get rated voltage and current from a model name, for example ``GEN600-1.3``.

    Raises
    ------
    ValueError
        When they are not in the name.
    """
    match = _MODEL.search(model)
    if match is None:
        raise ValueError(f"{model!r} contains no rating")
    return float(match[1]), float(match[2])
