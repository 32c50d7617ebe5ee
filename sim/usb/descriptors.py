"""USB descriptors as data, with the field names of the USB standard, which pyusb uses."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, TypeVar, cast

T = TypeVar("T")

BULK = 0x02
INTERRUPT = 0x03
ISOCHRONOUS = 0x01

FULL_SPEED = 2  # libusb's numbers of the speeds
HIGH_SPEED = 3

LANGUAGE = 0x0409  # English (United States), the only one offered


@dataclass(frozen=True)
class Endpoint:
    """One endpoint of an alternate setting."""

    bEndpointAddress: int
    bmAttributes: int
    wMaxPacketSize: int
    bInterval: int = 0
    bRefresh: int = 0
    bSynchAddress: int = 0
    extra_descriptors: tuple[int, ...] = ()
    bLength: ClassVar[int] = 7
    bDescriptorType: ClassVar[int] = 5

    def to_bytes(self) -> bytes:
        """Get the descriptor as it crosses the bus."""
        head = (self.bLength, self.bDescriptorType, self.bEndpointAddress, self.bmAttributes)
        return struct.pack("<BBBBHB", *head, self.wMaxPacketSize, self.bInterval)


@dataclass(frozen=True)
class Interface:
    """One alternate setting of an interface."""

    endpoints: tuple[Endpoint, ...]
    bInterfaceNumber: int = 0
    bAlternateSetting: int = 0
    bInterfaceClass: int = 0xFF
    bInterfaceSubClass: int = 0
    bInterfaceProtocol: int = 0
    iInterface: int = 0
    extra_descriptors: tuple[int, ...] = ()
    bLength: ClassVar[int] = 9
    bDescriptorType: ClassVar[int] = 4

    @property
    def bNumEndpoints(self) -> int:
        """Get the number of endpoints besides endpoint 0."""
        return len(self.endpoints)

    def to_bytes(self) -> bytes:
        """Get the descriptor and its endpoints as they cross the bus."""
        head = struct.pack(
            "<9B",
            self.bLength,
            self.bDescriptorType,
            self.bInterfaceNumber,
            self.bAlternateSetting,
            self.bNumEndpoints,
            self.bInterfaceClass,
            self.bInterfaceSubClass,
            self.bInterfaceProtocol,
            self.iInterface,
        )
        return head + b"".join(endpoint.to_bytes() for endpoint in self.endpoints)


@dataclass(frozen=True)
class Configuration:
    """One configuration: all alternate settings of all its interfaces, in the order of the descriptors."""

    interfaces: tuple[Interface, ...]
    bConfigurationValue: int = 1
    iConfiguration: int = 0
    bmAttributes: int = 0x80
    bMaxPower: int = 50
    extra_descriptors: tuple[int, ...] = ()
    bLength: ClassVar[int] = 9
    bDescriptorType: ClassVar[int] = 2

    @property
    def bNumInterfaces(self) -> int:
        """Get the number of interfaces (alternate settings do not count)."""
        return len({interface.bInterfaceNumber for interface in self.interfaces})

    @property
    def wTotalLength(self) -> int:
        """Get the length of the whole tree in bytes."""
        return self.bLength + sum(len(interface.to_bytes()) for interface in self.interfaces)

    def alternates(self, index: int) -> tuple[Interface, ...]:
        """Get the alternate settings of the interface with this logical index.

        Raises
        ------
        IndexError
            When there is no such interface.
        """
        numbers = list(dict.fromkeys(interface.bInterfaceNumber for interface in self.interfaces))
        return tuple(i for i in self.interfaces if i.bInterfaceNumber == numbers[index])

    def to_bytes(self) -> bytes:
        """Get the whole tree as it crosses the bus."""
        head = struct.pack(
            "<BBHBBBBB",
            self.bLength,
            self.bDescriptorType,
            self.wTotalLength,
            self.bNumInterfaces,
            self.bConfigurationValue,
            self.iConfiguration,
            self.bmAttributes,
            self.bMaxPower,
        )
        return head + b"".join(interface.to_bytes() for interface in self.interfaces)


@dataclass(frozen=True)
class Device:
    """A device: identity, strings (index 1 first), configurations and bus speed (libusb's number)."""

    idVendor: int
    idProduct: int
    bcdDevice: int
    configurations: tuple[Configuration, ...]
    strings: tuple[str, ...] = ()
    iManufacturer: int = 0
    iProduct: int = 0
    iSerialNumber: int = 0
    speed: int = HIGH_SPEED
    bMaxPacketSize0: int = 64
    bcdUSB: int = 0x0200
    bDeviceClass: int = 0
    bDeviceSubClass: int = 0
    bDeviceProtocol: int = 0
    bLength: ClassVar[int] = 18
    bDescriptorType: ClassVar[int] = 1

    @property
    def bNumConfigurations(self) -> int:
        """Get the number of configurations."""
        return len(self.configurations)

    def to_bytes(self) -> bytes:
        """Get the device descriptor as it crosses the bus."""
        return struct.pack(
            "<BBHBBBBHHHBBBB",
            self.bLength,
            self.bDescriptorType,
            self.bcdUSB,
            self.bDeviceClass,
            self.bDeviceSubClass,
            self.bDeviceProtocol,
            self.bMaxPacketSize0,
            self.idVendor,
            self.idProduct,
            self.bcdDevice,
            self.iManufacturer,
            self.iProduct,
            self.iSerialNumber,
            self.bNumConfigurations,
        )

    def descriptor(self, kind: int, index: int) -> bytes:
        """Get what GET_DESCRIPTOR answers: device (1), configuration (2) or string (3).

        Raises
        ------
        IndexError
            When there is no such descriptor.
        """
        if kind == 1:
            return self.to_bytes()
        if kind == 2:
            return self.configurations[index].to_bytes()
        if kind == 3:
            return self._string_bytes(index)
        raise IndexError(f"descriptor type {kind}")

    def _string_bytes(self, index: int) -> bytes:
        # String 0 is the list of languages.
        text = struct.pack("<H", LANGUAGE) if index == 0 else self.strings[index - 1].encode("utf-16-le")
        return bytes([2 + len(text), 3]) + text


def device_from_plain(table: Mapping[str, object]) -> Device:
    """Make a device from the result of ``dataclasses.asdict`` (lists may stand for tuples)."""
    configurations = tuple(
        _made(Configuration, row, interfaces=tuple(_interface(part) for part in _rows(row, "interfaces")))
        for row in _rows(table, "configurations")
    )
    return _made(Device, table, configurations=configurations)


def _interface(table: Mapping[str, object]) -> Interface:
    return _made(Interface, table, endpoints=tuple(_made(Endpoint, row) for row in _rows(table, "endpoints")))


def _rows(table: Mapping[str, object], name: str) -> list[Mapping[str, object]]:
    return cast("list[Mapping[str, object]]", table[name])


def _made(kind: Callable[..., T], table: Mapping[str, object], **parts: object) -> T:
    fields = {**table, **parts}
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()})
