# ruff: noqa: ARG002 (the arguments are those of the UsbFirmware protocol)
"""Firmware of the simulated Helios DAC (version 6): commands, two frame buffers, and the mirrors' command.

Source: protocol sheet ``helios_dac.md``. A frame is played by one timer for each *change* of its points,
not for each point.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers import helios_wire as wire
from drivers.clock import Clock, Timer
from drivers.helios_wire import Answer, Command, FrameFlag, GalvoFrame
from sim.usb.descriptors import BULK, FULL_SPEED, INTERRUPT, ISOCHRONOUS, Configuration, Device, Endpoint, Interface
from sim.usb.firmware import Setup, UsbStall
from sim.wires import Mirrors

FIRMWARE_VERSION = 6
BUFFER_BYTES = 28_677
STOP_S = 0.1
MARKER_LEVEL = 127
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


@dataclass(frozen=True)
class _Change:
    """What happens at one point of a frame: a new place (None: the same), and whether the marker line rises."""

    after_s: float
    place: tuple[float, float] | None
    marker_rises: bool


class HeliosFirmware:
    """A Helios DAC.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    mirrors : Mirrors
        Told of each new place when its point is played.
    name : str
        Name of the unit.

    Attributes
    ----------
    on_marker : list of callables
        Called when the blue line rises above 127.
    shutter_open : bool
    points_played, frames_dropped : int
        Points output so far, and frames whose length was wrong or that came while it was deaf.
    """

    descriptors = DESCRIPTORS

    def __init__(self, clock: Clock, mirrors: Mirrors, *, name: str = "picoradar") -> None:
        self.clock = clock
        self.mirrors = mirrors
        self.name = name
        self.on_marker: list[Callable[[], None]] = []
        self.shutter_open = False
        self.points_played = 0
        self.frames_dropped = 0
        self.sdk_version = 0
        self._awake = False
        self._answers: deque[bytes] = deque(maxlen=8)
        self._partial = b""
        self._playing: GalvoFrame | None = None
        self._waiting: GalvoFrame | None = None
        self._started = 0.0
        self._deaf_until = 0.0
        self._timer: Timer | None = None
        self._marker_high = False

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
        if self._waiting is not None and not self._starts_at_once(data):
            return False
        self._partial += data
        if data and len(data) % wire.PACKET == 0 and len(self._partial) < BUFFER_BYTES:
            return True  # no short packet has ended the transfer: the rest seems to be still to come
        frame, self._partial = wire.decode_frame(self._partial), b""
        if frame is None or self.clock.now() < self._deaf_until:
            self.frames_dropped += 1
        else:
            self._accept(frame)
        return True

    def take(self, endpoint: int) -> bytes | None:
        """Give the next answer."""
        return self._answers.popleft() if endpoint == wire.EP_ANSWER and self._answers else None

    def configured(self, value: int) -> None:
        """Stop when a configuration is set anew."""
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
                self._timer = self.clock.call_at(self._deaf_until, lambda: self.mirrors.command(0.0, 0.0))
            case Command.SHUTTER:
                self.shutter_open = bool(argument)
            case Command.STATUS:
                self._partial = b""  # re-arms the reception of frames
                self._answers.append(bytes([Answer.STATUS, self._waiting is None]))
            case Command.FIRMWARE:
                self._answers.append(bytes([Answer.FIRMWARE]) + FIRMWARE_VERSION.to_bytes(4, "little"))
            case Command.NAME:
                self._answers.append((bytes([Answer.NAME]) + self.name.encode("ascii")).ljust(32, b"\0"))
            case Command.SET_NAME:
                self.name = wire.decode_name(data[1:31])
            case Command.SDK_VERSION:
                self.sdk_version = argument

    @staticmethod
    def _starts_at_once(data: bytes) -> bool:
        frame = wire.decode_frame(data)
        return frame is not None and bool(frame.flags & FrameFlag.START_AT_ONCE)

    def _accept(self, frame: GalvoFrame) -> None:
        if self._playing is None or frame.flags & FrameFlag.START_AT_ONCE:
            self._waiting = None
            self._start(frame)
            return
        self._waiting = frame
        if self._timer is None:  # an unchanging frame that repeats sets no timers: it ends with its present round
            period_s = _duration_s(self._playing)
            rounds = int((self.clock.now() - self._started) / period_s) + 1
            self._timer = self.clock.call_at(self._started + rounds * period_s, self._frame_ended)

    def _start(self, frame: GalvoFrame) -> None:
        self._cancel()
        self._playing = frame
        self._started = self.clock.now()
        self.points_played += len(frame.xy)
        changes = self._changes(frame)
        if changes and changes[0].after_s == 0.0:
            self._apply(changes.popleft())
        if self._playing is frame:  # a marker's listener may have stopped it
            self._next(frame, changes)

    def _changes(self, frame: GalvoFrame) -> deque[_Change]:
        """Find the points at which something changes: the place, or the marker line rises."""
        high = frame.colours[:, 2] > MARKER_LEVEL
        rises = high & ~np.concatenate([[self._marker_high], high[:-1]])
        moved = np.concatenate([[True], (np.diff(frame.xy.astype(int), axis=0) != 0).any(axis=1)])
        self._marker_high = bool(high[-1]) and not frame.flags & FrameFlag.PLAY_ONCE
        volts = (frame.xy.astype(float) - wire.CENTRE) / wire.CENTRE
        period_s = 1.0 / max(wire.RATE_MIN_HZ, frame.rate_hz)
        return deque(
            _Change(float(i) * period_s, (float(volts[i, 0]), float(volts[i, 1])) if moved[i] else None, bool(rises[i]))
            for i in np.flatnonzero(moved | rises)
        )

    def _next(self, frame: GalvoFrame, changes: deque[_Change]) -> None:
        """Set the one timer for the next change, or for the end of the frame."""
        if changes:
            change = changes.popleft()

            def play() -> None:
                self._apply(change)
                if self._playing is frame:
                    self._next(frame, changes)

            self._timer = self.clock.call_at(self._started + change.after_s, play)
            return
        still = bool((frame.xy == frame.xy[0]).all()) and not (frame.colours[:, 2] > MARKER_LEVEL).any()
        if still and not frame.flags & FrameFlag.PLAY_ONCE and self._waiting is None:
            self._timer = None
        else:
            self._timer = self.clock.call_at(self._started + _duration_s(frame), self._frame_ended)

    def _apply(self, change: _Change) -> None:
        if change.place is not None:
            self.mirrors.command(*change.place)
        if change.marker_rises:
            for listener in self.on_marker:
                listener()

    def _frame_ended(self) -> None:
        ended, self._playing, self._timer = self._playing, None, None
        following, self._waiting = self._waiting, None
        if following is not None:
            self._start(following)
        elif ended is not None and not ended.flags & FrameFlag.PLAY_ONCE:
            self._start(ended)

    def _halt_output(self) -> None:
        self._cancel()
        self._playing = self._waiting = None
        self._partial = b""
        self._marker_high = False

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def _duration_s(frame: GalvoFrame) -> float:
    return len(frame.xy) / max(wire.RATE_MIN_HZ, frame.rate_hz)
