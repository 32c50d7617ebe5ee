"""pyserial's URL handlers of the simulator; importing this package makes ``sim://`` known to pyserial."""

import serial

from picoradar.sim.ports.wire import SerialFirmware, SerialWire, new_bench_name, publish, withdraw

if __name__ not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append(__name__)

__all__ = [
    "SerialFirmware",
    "SerialWire",
    "new_bench_name",
    "publish",
    "withdraw",
]
