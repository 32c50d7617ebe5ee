# ruff: noqa: ARG002 (the arguments are those of pyusb's interface)
"""The half of a pyusb backend that only looks at descriptors, for the bus itself and for its forwarded end."""

from __future__ import annotations

from array import array
from types import SimpleNamespace
from typing import Protocol

import usb.backend

from picoradar.sim.usb import errors
from picoradar.sim.usb.descriptors import Configuration, Device, Endpoint, Interface

BUS = 1
_DEVICE_FIELDS = (
    "bLength",
    "bDescriptorType",
    "bcdUSB",
    "bDeviceClass",
    "bDeviceSubClass",
    "bDeviceProtocol",
    "bMaxPacketSize0",
    "idVendor",
    "idProduct",
    "bcdDevice",
    "iManufacturer",
    "iProduct",
    "iSerialNumber",
    "bNumConfigurations",
    "speed",
)


class Described(Protocol):
    """A device on the bus: what `enumerate_devices` gives."""

    @property
    def descriptors(self) -> Device:
        """Get its descriptors."""

    @property
    def address(self) -> int:
        """Get its address on the bus."""


class DescribedBackend(usb.backend.IBackend):
    """Descriptors by their logical indices (IndexError past the last one); refuses what no device here can do."""

    def get_parent(self, dev: Described) -> None:
        """Get None: there are no hubs, every device is connected to the root."""

    def get_device_descriptor(self, dev: Described) -> SimpleNamespace:
        """Get the device descriptor with the place on the bus."""
        fields = {name: getattr(dev.descriptors, name) for name in _DEVICE_FIELDS}
        return SimpleNamespace(
            **fields, address=dev.address, bus=BUS, port_number=dev.address, port_numbers=(dev.address,)
        )

    def get_configuration_descriptor(self, dev: Described, config: int) -> Configuration:
        """Get a configuration descriptor."""
        return dev.descriptors.configurations[config]

    def get_interface_descriptor(self, dev: Described, intf: int, alt: int, config: int) -> Interface:
        """Get the descriptor of one alternate setting."""
        return dev.descriptors.configurations[config].alternates(intf)[alt]

    def get_endpoint_descriptor(self, dev: Described, ep: int, intf: int, alt: int, config: int) -> Endpoint:
        """Get an endpoint descriptor."""
        return self.get_interface_descriptor(dev, intf, alt, config).endpoints[ep]

    def iso_write(self, dev_handle: object, ep: int, intf: int, data: array[int], timeout: int) -> int:
        """Refuse: no device of this bench uses isochronous transfers."""
        raise errors.not_supported("isochronous transfers")

    def iso_read(self, dev_handle: object, ep: int, intf: int, buff: array[int], timeout: int) -> int:
        """Refuse: no device of this bench uses isochronous transfers."""
        raise errors.not_supported("isochronous transfers")

    def is_kernel_driver_active(self, dev_handle: object, intf: int) -> bool:
        """Get whether a kernel driver holds the interface: never, there is no kernel under this bus."""
        return False

    def detach_kernel_driver(self, dev_handle: object, intf: int) -> None:
        """Refuse: there is no kernel driver."""
        raise errors.not_found(f"kernel driver of interface {intf}")

    def attach_kernel_driver(self, dev_handle: object, intf: int) -> None:
        """Refuse: there is no kernel driver."""
        raise errors.not_found(f"kernel driver of interface {intf}")
