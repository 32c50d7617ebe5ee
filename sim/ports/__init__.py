"""pyserial's URL handlers of the simulator; importing this package makes ``sim://`` known to pyserial."""

import serial

if __name__ not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append(__name__)
