"""The drive supply TDK-Lambda GEN600-1.3: voltage, output, interlock."""

from picoradar.drivers.genesys.driver import Genesys
from picoradar.drivers.genesys.wire import END, Fault, Status, parse_rating

__all__ = [
    "END",
    "Fault",
    "Genesys",
    "Status",
    "parse_rating",
]
