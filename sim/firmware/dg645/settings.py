"""Settings of the simulated DG645 as a table: mnemonic, places it is indexed by, range, default, reply format."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation

from picoradar.sim.firmware.dg645.delays import DelayTree
from picoradar.sim.firmware.dg645.registers import Refused

ILLEGAL_VALUE, EMPTY, TOO_LONG, BAD_FLOAT, BAD_INTEGER, INTEGER_OVERFLOW = 10, 114, 117, 118, 120, 121
LONGEST_PARAMETER = 25
HIGHEST_LEVEL_V = 6  # amplitude and offset of an output together


@dataclass(frozen=True)
class Setting:
    """One row: ``places`` are the allowed indices (None: no index), ``style`` the format of the reply."""

    minimum: float
    maximum: float
    default: float
    style: str
    places: range | None = None

    @property
    def integral(self) -> bool:
        """Get whether the value is an integer."""
        return self.style == "d"

    def text(self, value: Decimal) -> str:
        """Write the reply."""
        return format(int(value) if self.integral else value, self.style)


OUTPUTS = range(5)
SETTINGS: dict[str, Setting] = {
    "TSRC": Setting(0, 6, 5, "d"),
    "TRAT": Setting(1e-4, 10e6, 1000, "+.6f"),
    "TLVL": Setting(-3.5, 3.5, 1, "+.2f"),
    "ADVT": Setting(0, 1, 0, "d"),
    "HOLD": Setting(0, 2000, 0, "+.12f"),
    "INHB": Setting(0, 5, 1, "d"),
    "BURM": Setting(0, 1, 0, "d"),
    "BURC": Setting(1, 2**32 - 1, 5, "d"),
    "BURP": Setting(100e-9, 42.9, 1e-4, "+.12f"),
    "BURD": Setting(0, 2000, 0, "+.12f"),
    "BURT": Setting(0, 1, 0, "d"),
    "PRES": Setting(1, 65535, 1, "d", OUTPUTS),
    "PHAS": Setting(0, 65534, 0, "d", range(1, 5)),
    "SSDL": Setting(0, 2000, 1e-9, "+.12f", range(2, 10)),
    "LAMP": Setting(0.5, 5, 2.5, "+.2f", OUTPUTS),
    "LOFF": Setting(-2, 2, 0, "+.2f", OUTPUTS),
    "LPOL": Setting(0, 1, 1, "d", OUTPUTS),
    "IFCF": Setting(0, 2**32 - 1, 0, "d", range(16)),
}


@dataclass
class Settings:
    """All that ``*SAV`` keeps: the values of the table, and the delays."""

    values: dict[tuple[str, int], Decimal] = field(
        default_factory=lambda: {
            (name, place): Decimal(repr(row.default))
            for name, row in SETTINGS.items()
            for place in (row.places or (0,))
        }
    )
    delays: DelayTree = field(default_factory=DelayTree)

    def get(self, name: str, place: int = 0) -> float:
        """Get one value."""
        return float(self.values[name, place])

    def set(self, name: str, parameters: list[str]) -> None:
        """Carry out one set command of the table."""
        row = SETTINGS[name]
        place = self._place(row, parameters)
        value = Decimal(integer(parameters[-1])) if row.integral else number(parameters[-1])
        if not Decimal(repr(row.minimum)) <= value <= Decimal(repr(row.maximum)):
            raise Refused(ILLEGAL_VALUE)
        other = {"LAMP": "LOFF", "LOFF": "LAMP"}.get(name)
        if other is not None and value + self.values[other, place] > HIGHEST_LEVEL_V:
            raise Refused(ILLEGAL_VALUE)
        self.values[name, place] = value

    def text(self, name: str, parameters: list[str]) -> str:
        """Write the reply to one query of the table."""
        row = SETTINGS[name]
        return row.text(self.values[name, self._place(row, parameters)])

    def copy(self) -> Settings:
        """Make an independent copy, for a memory."""
        return copy.deepcopy(self)

    @staticmethod
    def _place(row: Setting, parameters: list[str]) -> int:
        if row.places is None:
            return 0
        place = integer(parameters[0])
        if place not in row.places:
            raise Refused(ILLEGAL_VALUE)
        return place


def number(text: str) -> Decimal:
    """Read a float as the device does.

    Raises
    ------
    Refused
        When it is not a number.
    """
    _check_length(text)
    try:
        value = Decimal(text)
    except InvalidOperation:
        raise Refused(BAD_FLOAT) from None
    if not value.is_finite():
        raise Refused(BAD_FLOAT)
    return value


def integer(text: str) -> int:
    """Read an integer as the device does.

    Raises
    ------
    Refused
        When it is not an integer.
    """
    _check_length(text)
    if not text.removeprefix("-").removeprefix("+").isdecimal():
        raise Refused(BAD_INTEGER)
    value = int(text)
    if not -(2**31) <= value < 2**32:
        raise Refused(INTEGER_OVERFLOW)
    return value


def channel(text: str) -> int:
    """Read the number of a delay channel.

    Raises
    ------
    Refused
        When there is no such channel.
    """
    value = integer(text)
    if not 0 <= value <= 9:
        raise Refused(ILLEGAL_VALUE)
    return value


def _check_length(text: str) -> None:
    if not text:
        raise Refused(EMPTY)
    if len(text) > LONGEST_PARAMETER:
        raise Refused(TOO_LONG)
