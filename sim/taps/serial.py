"""The tap of a serial line."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.sim.ports import SerialFirmware

Pieces = list[tuple[bytes, float]]


def _discard(_data: bytes, _delay_s: float) -> None:
    """Discard answers while no line is connected."""


class SerialTap:
    """Between a serial line and the firmware of its device.

    Attributes
    ----------
    to_device : list of callables
        ``hook(data)`` returns what the device receives instead.
    to_host : list of callables
        ``hook(data, delay_s)`` returns the pieces ``(data, delay_s)`` that go on the line instead.
    """

    def __init__(self, firmware: SerialFirmware) -> None:
        self.firmware = firmware
        self.to_device: list[Callable[[bytes], bytes]] = []
        self.to_host: list[Callable[[bytes, float], Pieces]] = []
        self._send: Callable[[bytes, float], None] = _discard

    @property
    def baud(self) -> int:
        """Get the device's baud rate."""
        return self.firmware.baud

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send
        self.firmware.connect(self._answer)

    def receive(self, data: bytes) -> None:
        """Pass bytes of the host on."""
        for hook in self.to_device:
            data = hook(data)
        if data:
            self.firmware.receive(data)

    def say(self, data: bytes) -> None:
        """Put bytes on the line that the device has not sent."""
        self._send(data, 0.0)

    def _answer(self, data: bytes, delay_s: float) -> None:
        pieces: Pieces = [(data, delay_s)]
        for hook in self.to_host:
            pieces = [changed for piece in pieces for changed in hook(*piece)]
        for piece in pieces:
            self._send(*piece)
