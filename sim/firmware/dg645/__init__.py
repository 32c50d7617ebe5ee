"""The delay generator's firmware."""

from picoradar.sim.firmware.dg645.device import Dg645Firmware

__all__ = [
    "Dg645Firmware",
]
