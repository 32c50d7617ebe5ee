"""The laser pulser: trigger source and drive supply as one device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from picoradar.drivers.interfaces.device import Device

PRF_HZ = (20e3, 240e3)
DRIVE_V = (240.0, 330.0)
"""Rate and drive voltage that the pulser takes (docs/devices.md); below 234 V the diode does not give its short pulse
(dissertation, figure 2.5)."""


@dataclass(frozen=True)
class PulserStatus:
    """State of the pulser at one moment.

    Attributes
    ----------
    triggers_on, output_on, interlock_closed : bool
    prf_hz : float
    drive_v, measured_v, measured_a : float
        Set point and read-back of the drive supply.
    problem : str
        What the devices report as fault; empty when nothing is wrong.
    """

    triggers_on: bool
    output_on: bool
    interlock_closed: bool
    prf_hz: float
    drive_v: float
    measured_v: float
    measured_a: float
    problem: str = ""


class Pulser(Device, Protocol):
    """Trigger source and drive supply of the laser, as one."""

    def configure(self, *, prf_hz: float, drive_v: float) -> None:
        """Set rate (Hz) and drive voltage (V) with everything off, and read both back.

        Raises
        ------
        LimitError
            When a value is out of range; nothing was sent.
        """

    def on(self) -> None:
        """Switch the supply on, wait until it is within 1 %, then start the triggers; each step read back."""

    def off(self) -> None:
        """Stop the triggers, then the supply; both are tried even if one fails, each is read back.

        Raises
        ------
        DeviceError
            When one of them could not be verified off.
        """

    def watch(self) -> bool | None:
        """Look, without waiting, whether triggers and supply still answer; None while the answers are under way.

        Raises
        ------
        DeviceError
            When one of them has not answered in time: it could not be switched off.
        """

    def status(self) -> PulserStatus:
        """Measure the present state of both devices."""
