"""The sampling bridge: records and windows over USB, its gate and its watchdog (SBP)."""

from picoradar.drivers.bridge.driver import SamplingBridge, bridge_link

__all__ = [
    "SamplingBridge",
    "bridge_link",
]
