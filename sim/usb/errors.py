"""The errors of the bus, as libusb and the operating system number them."""

from __future__ import annotations

import errno

import usb.core


def gone() -> usb.core.USBError:
    """Make the error of a device that has been unplugged."""
    return usb.core.USBError("No such device (it may have been disconnected)", -4, errno.ENODEV)


def stalled() -> usb.core.USBError:
    """Make the error of a halted endpoint or a refused request."""
    return usb.core.USBError("Pipe error", -9, errno.EPIPE)


def timed_out() -> usb.core.USBTimeoutError:
    """Make the error of a transfer in which nothing was moved in time."""
    return usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)


def not_found(what: str) -> usb.core.USBError:
    """Make the error of an endpoint, interface or setting that is not there."""
    return usb.core.USBError(f"Entity not found: {what}", -5, errno.ENOENT)


def busy() -> usb.core.USBError:
    """Make the error of an interface that another handle has claimed."""
    return usb.core.USBError("Resource busy", -6, errno.EBUSY)


def overflow() -> usb.core.USBError:
    """Make the error of a device that sends a packet larger than what is left of the buffer."""
    return usb.core.USBError("Overflow", -8, errno.EOVERFLOW)


def not_supported(what: str) -> usb.core.USBError:
    """Make the error of what this bus cannot do."""
    return usb.core.USBError(f"Operation not supported: {what}", -12, errno.ENOTSUP)
