"""The tap of a USB device."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.clock import Clock
from picoradar.sim.usb import Setup, UsbFirmware, errors

CONTROL_TIMEOUT_S = 0.5


class UsbTap:
    """Between the bus and the firmware of a USB device; itself such a firmware.

    Attributes
    ----------
    before : list of callables
        ``hook(setup)`` is called before each control request and may raise any error of the bus.
    ignored : list of callables
        ``hook(setup, data)`` returns whether the device silently ignores this request.
    answers : list of callables
        ``hook(setup, answer)`` returns what the host gets instead.
    silent : bool
        Whether the device answers nothing at all.
    """

    def __init__(self, firmware: UsbFirmware, clock: Clock) -> None:
        self.firmware = firmware
        self.descriptors = firmware.descriptors
        self.clock = clock
        self.before: list[Callable[[Setup], None]] = []
        self.ignored: list[Callable[[Setup, bytes], bool]] = []
        self.answers: list[Callable[[Setup, bytes], bytes]] = []
        self.silent = False

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Pass a request on."""
        if self.silent:
            self.clock.sleep(CONTROL_TIMEOUT_S)
            raise errors.timed_out()
        for hook in self.before:
            hook(setup)
        if True in [hook(setup, data) for hook in self.ignored]:
            return b""
        answer = self.firmware.control(setup, data)
        for change in self.answers:
            answer = change(setup, answer)
        return answer

    def receive(self, endpoint: int, data: bytes) -> bool:
        """Pass an OUT transfer on."""
        return not self.silent and self.firmware.receive(endpoint, data)

    def take(self, endpoint: int) -> bytes | None:
        """Pass an IN transfer on."""
        return None if self.silent else self.firmware.take(endpoint)

    def configured(self, value: int) -> None:
        """Pass SET_CONFIGURATION on."""
        self.firmware.configured(value)

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """Pass SET_INTERFACE on."""
        self.firmware.alternate_selected(interface, alternate)

    def halt_cleared(self, endpoint: int) -> None:
        """Pass CLEAR_FEATURE on."""
        self.firmware.halt_cleared(endpoint)

    def bus_reset(self) -> None:
        """Pass a reset, or the loss of the bus, on."""
        self.firmware.bus_reset()
