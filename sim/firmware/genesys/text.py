"""How the simulated Genesys supply reads and writes what stands in its messages."""

from __future__ import annotations

import re

from picoradar.sim.firmware.genesys.supply import Refused

LONGEST_NUMBER = 12
ON_OFF = {True: "ON", False: "OFF"}
_NUMBER = re.compile(r"\d+\.?\d*|\.\d+", re.ASCII)


def checksum(text: str) -> str:
    """Compute the two hex digits of a message, whatever bytes it has."""
    return f"{sum(text.encode('latin-1')) & 0xFF:02X}"


def without_backspaces(text: str) -> str:
    """Take each backspace out, with the character before it."""
    kept: list[str] = []
    for character in text:
        if character != "\b":
            kept.append(character)
        elif kept:
            kept.pop()
    return "".join(kept)


def number(text: str) -> float:
    """Read a number as the supply does: at most 12 characters, no sign.

    Raises
    ------
    Refused
        With the error code of the sheet.
    """
    if len(text) > LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        raise Refused("C03")
    return float(text)


def switch(text: str) -> bool:
    """Read what switches on or off.

    Raises
    ------
    Refused
        With the error code of the sheet.
    """
    if text not in ("0", "1", "ON", "OFF"):
        raise Refused("C03")
    return text in ("1", "ON")


def two_hex_digits(text: str) -> int:
    """Read a register.

    Raises
    ------
    Refused
        With the error code of the sheet.
    """
    if not re.fullmatch(r"[0-9A-F]{2}", text):
        raise Refused("C03")
    return int(text, 16)
