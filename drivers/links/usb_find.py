"""Which of the devices on the bus is meant, and what it says of itself."""

from __future__ import annotations

from typing import Any

import usb.core
import usb.util

from picoradar.drivers.errors import LinkLost

ACCESS_REMEDY = "the device is there but this account may not open it: install the udev rule of docs/devices.md"


def find_device(
    device: str,
    backend: Any,
    vendor_id: int,
    product_id: int,
    serial_number: str | None,
    interface_class: tuple[int, int, int] | None,
) -> Any:
    """Find the one device that is meant.

    Parameters
    ----------
    device : str
        Its name for messages.
    backend : object or None
        A pyusb backend; None is libusb.
    vendor_id, product_id : int
        Identity to look for.
    serial_number : str or None
        None takes the only one there is.
    interface_class : tuple of int or None
        Class, subclass and protocol that one of its interfaces must have.

    Returns
    -------
    usb.core.Device

    Raises
    ------
    LinkLost
        When none or several are there, or their serial numbers cannot be read.
    """
    every = usb.core.find(find_all=True, backend=backend, idVendor=vendor_id, idProduct=product_id)
    found = [
        candidate
        for candidate in every
        if (serial_number is None or _serial_number_of(candidate, device) == serial_number)
        and (interface_class is None or _has_interface(candidate, interface_class))
    ]
    if not found:
        which = f" with serial number {serial_number}" if serial_number else ""
        raise LinkLost(device, f"no such device{which} on the bus", "plug it in, switch it on")
    if len(found) > 1:
        raise LinkLost(device, f"{len(found)} such devices are there", "name its serial number in the settings")
    return found[0]


def configuration_value(device: Any) -> int:
    """Get the active configuration; 0 for none."""
    try:
        return int(device.get_active_configuration().bConfigurationValue)
    except usb.core.USBError:
        return 0  # pyusb's way of saying that no configuration is set


def described(device: Any) -> dict[str, Any]:
    """Get what a transcript tells of a device: enough to make one like it."""
    fields = ("idVendor", "idProduct", "bcdDevice", "speed")
    settings = [
        {
            "number": i.bInterfaceNumber,
            "alternate": i.bAlternateSetting,
            "class": [i.bInterfaceClass, i.bInterfaceSubClass, i.bInterfaceProtocol],
            "endpoints": [[e.bEndpointAddress, e.bmAttributes, e.wMaxPacketSize, e.bInterval] for e in i],
        }
        for i in device.get_active_configuration()
    ]
    return {
        **{name: getattr(device, name) for name in fields},
        "strings": [device.manufacturer, device.product, device.serial_number],
        "interfaces": settings,
    }


def _serial_number_of(candidate: Any, device: str) -> str | None:
    try:
        found: str | None = candidate.serial_number
    except ValueError as error:  # without access to a device pyusb finds no strings in it
        raise LinkLost(device, "its serial number cannot be read: access denied", ACCESS_REMEDY) from error
    finally:
        usb.util.dispose_resources(candidate)
    return found


def _has_interface(candidate: Any, wanted: tuple[int, int, int]) -> bool:
    return any(
        (i.bInterfaceClass, i.bInterfaceSubClass, i.bInterfaceProtocol) == wanted
        for configuration in candidate
        for i in configuration
    )
