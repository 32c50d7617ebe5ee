"""Thorlabs TC200 at the wire: echo, answer, prompt (protocol sheet ``thorlabs_tc200``). Pure functions.

The device echoes the command and CR, then gives its answer and CR, then the prompt ``> `` without a line
end; the answer to ``stat?`` has the prompt in its line.
"""

from __future__ import annotations

import re
from enum import Enum, IntEnum, IntFlag

from picoradar.drivers.links import read_number

END = b"\r"
PROMPT = b"> "
UNITS = ("C", "Celsius", "")

_REFUSAL = re.compile(r"(?:Command error )?(CMD_\w+)")


class Mode(IntEnum):
    """``mode=``: hold a temperature, or run a programme."""

    NORMAL = 0
    CYCLE = 1


class Sensor(Enum):
    """``sns=``: what measures the temperature."""

    PTC100 = "ptc100"
    PTC1000 = "ptc1000"
    TH10K = "th10k"
    NTC10K = "ntc10k"


class Status(IntFlag):
    """Bits of ``stat?``; degC is both unit bits, K the higher one alone, else degF."""

    ENABLED = 0x01
    CYCLE = 0x02
    UNIT_LOW = 0x10
    UNIT_HIGH = 0x20

    @property
    def celsius(self) -> bool:
        """Get whether temperatures are in degC."""
        return Status.UNIT_LOW in self and Status.UNIT_HIGH in self


def encode(command: str) -> bytes:
    """Make the bytes of one command."""
    return command.encode("ascii") + END


def split_answer(received: bytes) -> tuple[str, str]:
    """Split what came up to and including a prompt into echo and answer.

    Raises
    ------
    ValueError
        When it is no ASCII text, has no prompt or no echo.
    """
    text = received.decode("ascii")
    if not text.endswith(PROMPT.decode()):
        raise ValueError(f"no prompt in {received!r}")
    echo, end, answer = text.removesuffix(PROMPT.decode()).partition("\r")
    if not end:
        raise ValueError(f"no echo in {received!r}")
    return echo, answer.strip()


def refusal_in(answer: str) -> str | None:
    """Get the error code in an answer; None when it is not a refusal."""
    match = _REFUSAL.search(answer)
    return match[1] if match else None


def read_temperature(answer: str) -> float:
    """Read a temperature in degC: ``30 C``, ``30 Celsius`` or ``30.0``.

    Raises
    ------
    ValueError
        When it is none, or in another unit.
    """
    number, _, unit = answer.partition(" ")
    if unit not in UNITS:
        raise ValueError(f"{answer!r} is no temperature in degC")
    return read_number(number)


def read_gains(answer: str) -> tuple[int, int, int]:
    """Read the answer to ``pid?``: ``2 0 220``.

    Raises
    ------
    ValueError
        When it is not three integers.
    """
    if not re.fullmatch(r"\d{1,3} \d{1,3} \d{1,3}", answer, re.ASCII):
        raise ValueError(f"{answer!r} are no three gains")
    p, i, d = (int(part) for part in answer.split(" "))
    return p, i, d


def read_status(answer: str) -> Status:
    """Read the answer to ``stat?``: a decimal number of one byte.

    Raises
    ------
    ValueError
        When it is none.
    """
    value = read_number(answer)
    if value != int(value) or not 0 <= value <= 255:
        raise ValueError(f"{answer!r} is no byte")
    return Status(int(value))
