"""From the errors of pyusb to those of the drivers."""

from __future__ import annotations

import errno

import usb.core

from picoradar.drivers.errors import DeviceError, LinkLost, ProtocolError, Stall, Timeout
from picoradar.drivers.links.usb_find import ACCESS_REMEDY

_GONE = (errno.ENODEV, errno.ENOENT, errno.ESHUTDOWN, errno.EIO)


def device_has_gone(error: usb.core.USBError) -> bool:
    """Get whether an error says that the device is no longer on the bus."""
    return error.errno in _GONE


def translated(error: usb.core.USBError, device: str, doing: str) -> DeviceError:
    """Make the drivers' error for one of pyusb.

    Parameters
    ----------
    error : usb.core.USBError
    device : str
        The device's name for messages.
    doing : str
        What was being done.

    Returns
    -------
    DeviceError
        `Timeout`, `Stall`, `LinkLost` or `ProtocolError`.
    """
    if isinstance(error, usb.core.USBTimeoutError) or error.errno == errno.ETIMEDOUT:
        return Timeout(device, f"{doing}: no answer in time", "check power and cable")
    if error.errno == errno.EPIPE:
        return Stall(device, f"{doing}: refused (stall)")
    if error.errno == errno.EACCES:
        return LinkLost(device, f"{doing}: access denied", ACCESS_REMEDY)
    if error.errno == errno.EBUSY:
        return LinkLost(device, f"{doing}: in use by another program", "close the other program")
    if device_has_gone(error):
        return LinkLost(device, f"{doing}: the device has gone", "plug it in and connect again")
    return ProtocolError(device, f"{doing}: {error}")
