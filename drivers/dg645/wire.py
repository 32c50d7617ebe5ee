"""SRS DG645 at the wire: codes, numbers and lines (protocol sheet ``dg645``). Pure functions.

Commands end with LF, replies with CR LF. Set commands give no reply; errors go to a queue of 20 that
``LERR?`` reads.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import IntEnum, IntFlag

COMMAND_END = b"\n"
REPLY_END = b"\r\n"
QUEUE_LENGTH = 20

ERRORS = {
    0: "no error",
    10: "illegal value",
    11: "illegal mode",
    12: "illegal delay",
    13: "illegal link (a channel may not refer to itself, directly or in a loop, nor to T1)",
    14: "recall failed",
    15: "not allowed (locked)",
    16: "self test failed",
    17: "calibration failed",
    30: "lost data",
    32: "no listener",
    40: "failed ROM check",
    **{41 + i: f"failed offset of {name}" for i, name in enumerate(("T0", "AB", "CD", "EF", "GH"))},
    **{46 + i: f"failed amplitude of {name}" for i, name in enumerate(("T0", "AB", "CD", "EF", "GH"))},
    51: "failed FPGA",
    52: "failed GPIB",
    53: "failed DDS",
    54: "failed EEPROM",
    55: "failed temperature sensor",
    56: "failed PLL",
    **{57 + i: f"failed DAC {i}" for i in range(3)},
    60: "failed sample and hold",
    61: "failed Vjitter",
    **{62 + i: f"failed analogue delay of {name}" for i, name in enumerate(("T0", "T1", *"ABCDEFGH"))},
    80: "failed calibration of sample and hold",
    **{81 + i: f"failed calibration of {name}" for i, name in enumerate(("T0", "T1", *"ABCDEFGH"))},
    91: "failed calibration of Vjitter",
    110: "illegal command",
    111: "undefined command",
    112: "illegal query",
    113: "illegal set",
    114: "empty parameter",
    115: "too many parameters",
    116: "too few parameters",
    117: "parameter too long",
    118: "bad float",
    120: "bad integer",
    121: "integer overflow",
    122: "bad hexadecimal",
    126: "syntax error",
    170: "communication error",
    171: "overrun",
    254: "error queue overflow",
}


class TriggerSource(IntEnum):
    """What starts a cycle (``TSRC``); `SINGLE_SHOT` is the safe state: no triggers unless ``*TRG``."""

    INTERNAL = 0
    EXTERNAL_RISING = 1
    EXTERNAL_FALLING = 2
    SINGLE_EXTERNAL_RISING = 3
    SINGLE_EXTERNAL_FALLING = 4
    SINGLE_SHOT = 5
    LINE = 6


class Channel(IntEnum):
    """Delay channels; T0 and T1 cannot be set, T1 is the end of the longest delay."""

    T0 = 0
    T1 = 1
    A = 2
    B = 3
    C = 4
    D = 5
    E = 6
    F = 7
    G = 8
    H = 9


class Output(IntEnum):
    """Front panel outputs."""

    T0 = 0
    AB = 1
    CD = 2
    EF = 3
    GH = 4


class Inhibit(IntEnum):
    """What the rear INHIBIT input acts on (``INHB``)."""

    NOTHING = 0
    TRIGGERS = 1
    AB = 2
    AB_CD = 3
    AB_CD_EF = 4
    ALL = 5


class TimeBase(IntEnum):
    """Time base in use (``TIMB?``)."""

    INTERNAL = 0
    OCXO = 1
    RUBIDIUM = 2
    EXTERNAL = 3


class InstrumentStatus(IntFlag):
    """Bits of ``INSR?``; reading clears them."""

    TRIGGERED = 0x01
    RATE = 0x02
    END_OF_DELAY = 0x04
    END_OF_BURST = 0x08
    INHIBITED = 0x10
    DELAY_ABORTED = 0x20
    PLL_UNLOCKED = 0x40
    RUBIDIUM_UNLOCKED = 0x80


@dataclass(frozen=True)
class Delay:
    """A delay as ``DLAY?`` gives it: ``delay_s`` after the channel ``reference``."""

    reference: Channel
    delay_s: float


def encode(text: str) -> bytes:
    """Make the bytes of one command or query."""
    return text.encode("ascii") + COMMAND_END


def decode(line: bytes) -> str:
    """Get the text of one reply line.

    Raises
    ------
    ValueError
        When it is no ASCII text.
    """
    text = line.decode("ascii").strip()
    if not text.isprintable():
        raise ValueError(f"control characters in {line!r}")
    return text


def format_number(value: float) -> str:
    """Write a number in its shortest exact form: ``80000``, ``1e-7``, ``3.3``."""
    text = repr(float(value))
    text = text.removesuffix(".0")
    return re.sub(r"e([+-])0*(\d)", lambda m: "e" + m[1].replace("+", "") + m[2], text)


def parse_delay(text: str) -> Delay:
    """Read the reply to ``DLAY?``, for example ``2,+0.000000010000``.

    Raises
    ------
    ValueError
        When it is none.
    """
    reference, delay_s = text.split(",")
    return Delay(Channel(int(reference)), float(delay_s))
