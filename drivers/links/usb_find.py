"""Finding the right device on the USB bus, and describing it."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import usb.core
import usb.util

from picoradar.drivers.errors import LinkLost

ACCESS_REMEDY = "the device is there but this account may not open it: install the udev rule of docs/devices.md"


class UsbDevice(Protocol):
    """A device as pyusb gives it (``usb.core.Device``), as far as the links use it."""

    bNumConfigurations: int
    serial_number: str | None

    def write(self, endpoint: int, data: bytes, timeout: int) -> int: ...
    def read(self, endpoint: int, size_or_buffer: int, timeout: int) -> array[int]: ...
    def ctrl_transfer(
        self, bmRequestType: int, bRequest: int, wValue: int, wIndex: int, data_or_wLength: int | bytes, timeout: int
    ) -> int | array[int]: ...
    def clear_halt(self, endpoint: int) -> None: ...
    def set_configuration(self) -> None: ...
    def set_interface_altsetting(self, interface: int, alternate: int) -> None: ...
    def is_kernel_driver_active(self, interface: int) -> bool: ...
    def detach_kernel_driver(self, interface: int) -> None: ...
    def get_active_configuration(self) -> UsbConfiguration: ...
    def __iter__(self) -> Iterator[UsbConfiguration]: ...


class UsbConfiguration(Protocol):
    """A configuration as pyusb gives it: its alternate settings in a row."""

    bConfigurationValue: int

    def __iter__(self) -> Iterator[UsbInterface]: ...


class UsbInterface(Protocol):
    """An alternate setting as pyusb gives it: its endpoints in a row."""

    bInterfaceNumber: int
    bAlternateSetting: int
    bInterfaceClass: int
    bInterfaceSubClass: int
    bInterfaceProtocol: int

    def __iter__(self) -> Iterator[UsbEndpoint]: ...


class UsbEndpoint(Protocol):
    """An endpoint as pyusb gives it."""

    bEndpointAddress: int
    bmAttributes: int
    wMaxPacketSize: int
    bInterval: int


@dataclass(frozen=True)
class UsbIdentity:
    """What distinguishes the wanted device from the others on the bus.

    Attributes
    ----------
    vendor_id, product_id : int
    serial_number : str, optional
        Needed only where several devices of the same kind are plugged in.
    interface_class : tuple of int, optional
        Class, subclass and protocol that one of its interfaces must have.
    """

    vendor_id: int
    product_id: int
    serial_number: str | None = None
    interface_class: tuple[int, int, int] | None = None

    def __str__(self) -> str:
        return f"USB {self.vendor_id:04x}:{self.product_id:04x}"


def find_device(device: str, wanted: UsbIdentity, backend: object | None) -> UsbDevice:
    """Find the one device that has the wanted identity.

    Parameters
    ----------
    device : str
        Its name for messages.
    wanted : UsbIdentity
    backend : object or None
        A pyusb backend; None is libusb.

    Raises
    ------
    LinkLost
        When there is none or more than one, or the serial numbers cannot be read.
    """
    every: Iterable[UsbDevice] = usb.core.find(
        find_all=True, backend=backend, idVendor=wanted.vendor_id, idProduct=wanted.product_id
    )
    found = [
        candidate
        for candidate in every
        if (wanted.serial_number is None or _serial_number_of(candidate, device) == wanted.serial_number)
        and (wanted.interface_class is None or _has_interface(candidate, wanted.interface_class))
    ]
    if not found:
        which = f" with serial number {wanted.serial_number}" if wanted.serial_number else ""
        raise LinkLost(device, f"no such device{which} on the bus", "plug it in, switch it on")
    if len(found) > 1:
        raise LinkLost(device, f"{len(found)} such devices are there", "name its serial number in the settings")
    return found[0]


def configuration_value(device: UsbDevice) -> int:
    """Get the active configuration; 0 for none."""
    try:
        return int(device.get_active_configuration().bConfigurationValue)
    except usb.core.USBError:
        return 0  # pyusb raises this when no configuration is set


def describe_device(device: UsbDevice) -> dict[str, object]:
    """Describe a device for a transcript, completely enough to imitate it."""
    fields = ("idVendor", "idProduct", "bcdDevice", "speed")
    texts = ("manufacturer", "product", "serial_number")
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
        "strings": [getattr(device, name) for name in texts],
        "interfaces": settings,
    }


def _serial_number_of(candidate: UsbDevice, device: str) -> str | None:
    try:
        return candidate.serial_number
    except ValueError as error:  # without access to a device pyusb finds no strings in it
        raise LinkLost(device, "its serial number cannot be read: access denied", ACCESS_REMEDY) from error
    finally:
        usb.util.dispose_resources(candidate)


def _has_interface(candidate: UsbDevice, wanted: tuple[int, int, int]) -> bool:
    return any(
        (i.bInterfaceClass, i.bInterfaceSubClass, i.bInterfaceProtocol) == wanted
        for configuration in candidate
        for i in configuration
    )
