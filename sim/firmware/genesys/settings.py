"""Settings of the simulated Genesys supply: what it keeps over a power cycle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict


@dataclass(frozen=True)
class Settings:
    """What ``SAV`` keeps; set points and limits as they were sent, for ``PV?`` returns the text.

    Before any text was sent they have the form of the front panel: 5 digits, 4 for the limits (*unverified*).
    """

    overvoltage_text: str
    voltage_text: str = "000.00"
    current_text: str = "0.0000"
    undervoltage_text: str = "000.0"
    foldback: bool = False
    auto_start: bool = False

    @property
    def voltage_v(self) -> float:
        """Get the voltage set point."""
        return float(self.voltage_text)

    @property
    def current_a(self) -> float:
        """Get the current limit."""
        return float(self.current_text)

    @property
    def overvoltage_v(self) -> float:
        """Get the over-voltage trip."""
        return float(self.overvoltage_text)

    @property
    def undervoltage_v(self) -> float:
        """Get the lower limit of the set point."""
        return float(self.undervoltage_text)


class Changes(TypedDict, total=False):
    """Settings that change, under the names of `Settings`."""

    overvoltage_text: str
    voltage_text: str
    current_text: str
    undervoltage_text: str
    foldback: bool
    auto_start: bool
