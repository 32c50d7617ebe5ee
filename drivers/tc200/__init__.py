"""The heater controller Thorlabs TC200: another manufacturer's device behind the same interface."""

from picoradar.drivers.tc200.driver import TC200
from picoradar.drivers.tc200.wire import Mode, Sensor, Status

__all__ = ["TC200", "Mode", "Sensor", "Status"]
