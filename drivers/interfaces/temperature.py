"""The temperature controller of the laser diode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from picoradar.drivers.interfaces.device import Device


@dataclass(frozen=True)
class TemperatureStatus:
    """State of the temperature controller at one moment.

    Attributes
    ----------
    temperature_degc, target_degc : float
    regulating : bool
        Whether its output is on and controlled.
    stable : bool
        Whether it is stable by its own criterion.
    problem : str
        What it reports as a fault; empty when nothing is wrong.
    """

    temperature_degc: float
    target_degc: float
    regulating: bool
    stable: bool
    problem: str = ""


class TemperatureController(Device, Protocol):
    """Keeps the laser diode at its temperature."""

    def regulate(self, target_degc: float) -> None:
        """Set the target (degC) and switch the output on; both read back."""

    def off(self) -> None:
        """Switch the output off; read back."""

    def status(self) -> TemperatureStatus:
        """Measure the present state."""
