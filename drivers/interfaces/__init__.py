"""What the controller may rely on, whoever made a device.

Each protocol is small on purpose: a device of another manufacturer is one new folder that satisfies it, and one line
in the settings. Every method that switches something reads the result back from the device before it returns.
"""

from picoradar.drivers.interfaces.device import Device, Identity
from picoradar.drivers.interfaces.galvo import Galvo
from picoradar.drivers.interfaces.pulser import DRIVE_V, PRF_HZ, Pulser, PulserStatus
from picoradar.drivers.interfaces.records import Record, SweepSettings, WindowRecord
from picoradar.drivers.interfaces.sampler import WATCHDOG_S, Sampler, SamplerStatus
from picoradar.drivers.interfaces.temperature import TemperatureController, TemperatureStatus

__all__ = [
    "DRIVE_V",
    "PRF_HZ",
    "WATCHDOG_S",
    "Device",
    "Galvo",
    "Identity",
    "Pulser",
    "PulserStatus",
    "Record",
    "Sampler",
    "SamplerStatus",
    "SweepSettings",
    "TemperatureController",
    "TemperatureStatus",
    "WindowRecord",
]
