"""The temperature controller's firmware and its control loop."""

from picoradar.sim.firmware.mecom.device import TecFirmware

__all__ = [
    "TecFirmware",
]
