"""The TC200's firmware."""

from picoradar.sim.firmware.tc200.device import Tc200Firmware

__all__ = ["Tc200Firmware"]
