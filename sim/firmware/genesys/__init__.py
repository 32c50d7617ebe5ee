"""The drive supply's firmware."""

from picoradar.sim.firmware.genesys.device import GenesysFirmware

__all__ = [
    "GenesysFirmware",
]
