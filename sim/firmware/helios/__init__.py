"""The galvo controller's firmware."""

from picoradar.sim.firmware.helios.device import HeliosFirmware

__all__ = [
    "HeliosFirmware",
]
