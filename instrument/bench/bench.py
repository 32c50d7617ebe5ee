"""The devices of one bench, opened by the settings."""

from __future__ import annotations

from dataclasses import dataclass

from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Device, Galvo, Identity, Pulser, Sampler, TemperatureController


@dataclass
class Bench:
    """The devices that the controller drives.

    Attributes
    ----------
    clock : Clock
        Time of all devices.
    pulser, diode, galvo, sampler
        Trigger and drive supply; temperature of the laser diode; mirrors; sampling bridge with the gate.
    """

    clock: Clock
    pulser: Pulser
    diode: TemperatureController
    galvo: Galvo
    sampler: Sampler

    def devices(self) -> dict[str, Device]:
        """Get all devices by name, in the order in which they are opened: the gate's owner first."""
        return {"sampler": self.sampler, "pulser": self.pulser, "diode": self.diode, "galvo": self.galvo}

    def suspected(self, error: BaseException) -> str:
        """Get the name of the device whose link an error names; empty when it names none."""
        about = getattr(error, "device", None)
        for name, device in self.devices().items():
            if about is not None and about == getattr(getattr(device, "link", None), "device", None):
                return name
        return ""

    def found_on(self) -> tuple[str, ...]:
        """Get what was on when the devices were opened: ``gate``, ``triggers``, ``supply``, ``diode``."""
        return tuple(name for device in self.devices().values() for name in device.found_on)

    def identify(self) -> dict[str, Identity]:
        """Get the identity of each device."""
        return {name: device.identify() for name, device in self.devices().items()}
