"""The sampling bridge's firmware."""

from picoradar.sim.firmware.bridge.device import SamplingBridgeFirmware

__all__ = [
    "SamplingBridgeFirmware",
]
