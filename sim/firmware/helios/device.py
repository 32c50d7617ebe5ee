# ruff: noqa: ARG002 (the arguments are those of the UsbFirmware protocol)
"""Firmware of the simulated Helios DAC (version 6): commands and the reception of frames.

Source: protocol sheet ``helios_dac.md``. Frames are played in `picoradar.sim.firmware.helios.player`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from picoradar.drivers.clock import Clock
from picoradar.drivers.helios import Answer, Command, FrameFlag, wire
from picoradar.sim.firmware.helios.player import FramePlayer
from picoradar.sim.usb import (
    BULK,
    FULL_SPEED,
    INTERRUPT,
    ISOCHRONOUS,
    Configuration,
    Device,
    Endpoint,
    Interface,
    Setup,
    UsbStall,
)
from picoradar.sim.wires import Mirrors

FIRMWARE_VERSION = 6
BUFFER_BYTES = 28_677
STOP_S = 0.1
_ERASE = 0xDE

_ENDPOINTS = (
    Endpoint(wire.EP_FRAME, BULK, 64),
    Endpoint(0x81, BULK, 64),
    Endpoint(wire.EP_COMMAND, INTERRUPT, 32, 1),
    Endpoint(wire.EP_ANSWER, INTERRUPT, 32, 1),
    Endpoint(0x84, ISOCHRONOUS, 1, 1),
    Endpoint(0x05, ISOCHRONOUS, 1, 1),
)
DESCRIPTORS = Device(
    wire.VENDOR_ID,
    wire.PRODUCT_ID,
    0x0200,
    (Configuration((Interface(()), Interface(_ENDPOINTS, bAlternateSetting=1)), bMaxPower=75),),
    strings=("Gitle Mikkelsen", "Helios Laser DAC"),
    iManufacturer=1,
    iProduct=2,
    speed=FULL_SPEED,
    bMaxPacketSize0=8,
)


class FirmwareErased(RuntimeError):
    """The host has sent the command that erases the firmware: on a real unit it would be lost."""


class HeliosFirmware:
    """A Helios DAC.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    mirrors : Mirrors
        Gets each new position when its point is played.
    name : str
        Name of the unit.

    Attributes
    ----------
    shutter_open : bool
    frames_dropped : int
        Frames whose length was wrong, or that came while the device was deaf after a stop.
    player : FramePlayer
    """

    descriptors = DESCRIPTORS

    def __init__(self, clock: Clock, mirrors: Mirrors, *, name: str = "picoradar") -> None:
        self.clock = clock
        self.player = FramePlayer(clock, mirrors)
        self.name = name
        self.shutter_open = False
        self.frames_dropped = 0
        self.sdk_version = 0
        self._awake = False
        self._answers: deque[bytes] = deque(maxlen=8)
        self._partial = b""
        self._deaf_until = 0.0

    @property
    def on_marker(self) -> list[Callable[[], None]]:
        """Get the functions that are called when the blue line rises above 127."""
        return self.player.on_marker

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Refuse: the device has no requests of its own."""
        raise UsbStall(f"request {setup.request:#04x} with {len(data)} bytes")

    def receive(self, endpoint: int, data: bytes) -> bool:
        """Take a command or (a part of) a frame; a frame waits (NAK) while both buffers are full."""
        if endpoint == wire.EP_COMMAND:
            self._command(data)
            return True
        if endpoint != wire.EP_FRAME:
            return True
        if self.player.full and not _starts_at_once(data):
            return False
        self._partial += data
        if data and len(data) % wire.PACKET == 0 and len(self._partial) < BUFFER_BYTES:
            return True  # no short packet has ended the transfer: more is to come
        frame, self._partial = wire.decode_frame(self._partial), b""
        if frame is None or self.clock.now() < self._deaf_until:
            self.frames_dropped += 1
        else:
            self.player.accept(frame)
        return True

    def take(self, endpoint: int) -> bytes | None:
        """Give the next answer."""
        return self._answers.popleft() if endpoint == wire.EP_ANSWER and self._answers else None

    def configured(self, value: int) -> None:
        """Stop when a configuration is set again."""
        self.bus_reset()

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """Wake with alternate setting 1, stop output with 0."""
        self._awake = alternate == 1
        if not self._awake:
            self._halt_output()

    def halt_cleared(self, endpoint: int) -> None:
        """Forget a half-received frame."""
        self._partial = b""

    def bus_reset(self) -> None:
        """Go dark and forget everything but the name."""
        self._awake = False
        self._answers.clear()
        self._halt_output()
        self.shutter_open = False

    def _command(self, data: bytes) -> None:
        if not data or not self._awake:
            return
        command, argument = data[0], data[1] if len(data) > 1 else 0
        if command == _ERASE:
            raise FirmwareErased("the host sent 0xDE, which erases the firmware of a Helios DAC")
        match command:
            case Command.STOP:
                self._halt_output()
                self._deaf_until = self.clock.now() + STOP_S
                self.player.centre_at(self._deaf_until)
            case Command.SHUTTER:
                self.shutter_open = bool(argument)
            case Command.STATUS:
                self._partial = b""  # re-arms the reception of frames
                self._answers.append(bytes([Answer.STATUS, not self.player.full]))
            case Command.FIRMWARE:
                self._answers.append(bytes([Answer.FIRMWARE]) + FIRMWARE_VERSION.to_bytes(4, "little"))
            case Command.NAME:
                self._answers.append((bytes([Answer.NAME]) + self.name.encode("ascii")).ljust(32, b"\0"))
            case Command.SET_NAME:
                self.name = wire.decode_name(data[1:31])
            case Command.SDK_VERSION:
                self.sdk_version = argument

    def _halt_output(self) -> None:
        self.player.halt()
        self._partial = b""


def _starts_at_once(data: bytes) -> bool:
    frame = wire.decode_frame(data)
    return frame is not None and bool(frame.flags & FrameFlag.START_AT_ONCE)
