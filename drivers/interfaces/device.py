"""What every device can do, and who it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Identity:
    """Identity of a device.

    Attributes
    ----------
    model, serial_number, firmware : str
        As the device reports them; empty where it does not report one.
    """

    model: str
    serial_number: str = ""
    firmware: str = ""

    def __str__(self) -> str:
        parts = [self.model, f"s/n {self.serial_number}" if self.serial_number else "", self.firmware]
        return ", ".join(p for p in parts if p)


class Device(Protocol):
    """What every device can do."""

    @property
    def found_on(self) -> tuple[str, ...]:
        """Get what was switched on when it was opened, before it was brought to its safe state: ``gate``,
        ``triggers``, ``supply``, ``diode``."""

    def open(self) -> None:
        """Open the link, identify the device and bring it into its safe state.

        Raises
        ------
        DeviceError
            Of the kind that fits: `LinkLost`, `Timeout`, `ProtocolError`, `DeviceFault`.
        """

    def close(self) -> None:
        """Bring the device into its safe state as far as the link allows, and close the link."""

    def identify(self) -> Identity:
        """Get manufacturer's model, serial number and firmware."""
