"""What a simulated device must offer to the bus; devices read apart from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from picoradar.sim.usb.descriptors import Device


class UsbStall(Exception):
    """Raised by a firmware to refuse a request, or to halt the endpoint that is being used."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Setup stage of a control transfer.

    Attributes
    ----------
    request_type, request, value, index, length : int
        bmRequestType, bRequest, wValue, wIndex and wLength of the standard.
    """

    request_type: int
    request: int
    value: int
    index: int
    length: int

    @property
    def to_host(self) -> bool:
        """Get whether the data stage goes from device to host."""
        return bool(self.request_type & 0x80)


class UsbFirmware(Protocol):
    """A device behind a USB plug.

    The bus calls these; nothing in the firmware moves the clock. A firmware sets its own timers on the clock.
    """

    descriptors: Device

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a class or vendor request; returns the data stage towards the host (else empty).

        Raises
        ------
        UsbStall
            To refuse it.
        """

    def receive(self, endpoint: int, data: bytes) -> bool:
        """Take the data of one OUT transfer; False when busy (the host has to try again: NAK).

        Raises
        ------
        UsbStall
            To halt the endpoint.
        """

    def take(self, endpoint: int) -> bytes | None:
        """Give the next IN transfer, which ends with a short packet; None when there is nothing (NAK).

        Raises
        ------
        UsbStall
            To halt the endpoint.
        """

    def configured(self, value: int) -> None:
        """Take note of SET_CONFIGURATION; 0 is the unconfigured state."""

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """Take note of SET_INTERFACE."""

    def halt_cleared(self, endpoint: int) -> None:
        """Take note that the host has taken an endpoint out of its halt."""

    def bus_reset(self) -> None:
        """Take note of a bus reset, or of the loss of the bus."""
