"""Helios laser DAC: two analogue outputs for the galvo amplifier, over USB.

The bytes are made in `picoradar.drivers.helios.wire`. Source: protocol sheet ``helios_dac.md``.
"""

from __future__ import annotations

import contextlib

from numpy.typing import ArrayLike

from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import DeviceError, DeviceFault, LimitError, ProtocolError, Timeout, check_range
from picoradar.drivers.helios import wire
from picoradar.drivers.helios.wire import Answer, Command
from picoradar.drivers.interfaces import Identity
from picoradar.drivers.links import UsbIdentity, UsbLink

WAKE_S = 0.1  # after alternate setting 1, before the first command
STOP_S = 0.1  # after a stop the device ignores frames for this long
FLUSH_S = 0.005
STATUS_S = 0.016
QUERY_S = 0.032
POLL_S = 0.001
FRAME_TIMEOUT_S = 0.008
FRAME_BYTES_PER_S = 32_000.0
BUSY_LIMIT_S = 1.0  # longest wait for a free buffer


def helios_link(clock: Clock, backend: object | None = None) -> UsbLink:
    """Make the link to a Helios DAC; it has no serial number, several are distinguished by name only."""
    identity = UsbIdentity(wire.VENDOR_ID, wire.PRODUCT_ID)
    return UsbLink(identity, clock, device="Helios DAC", alternate=1, backend=backend)


class Helios:
    """Galvo controller of 12 bits, moved by frames that are played once.

    A repeating frame would play on when the host is lost; none is ever sent.

    Parameters
    ----------
    link : UsbLink
        From `helios_link`.
    name : str, optional
        Name that the device must have; None accepts any.
    """

    found_on: tuple[str, ...] = ()  # mirrors make no light

    def __init__(self, link: UsbLink, *, name: str | None = None) -> None:
        self.link = link
        self.expected_name = name
        self._deaf_until = 0.0
        self._shutter_open = False
        self._identity = Identity("Helios DAC")

    @property
    def codes(self) -> int:
        """Get the number of codes an axis has; the centre is 2048."""
        return wire.CODES

    def open(self) -> None:
        """Open the link in the order of the manufacturer's SDK, and stop whatever may be playing.

        Raises
        ------
        DeviceError
            `LinkLost`, `Timeout` or `ProtocolError`; `DeviceFault` when it has another name than expected.
        """
        self.link.open()
        try:
            self.link.clock.sleep(WAKE_S)
            self._flush()
            firmware = self.firmware_version()
            self._send(Command.SDK_VERSION, wire.SDK_VERSION)
            name = self.name()
            if self.expected_name not in (None, name):
                raise DeviceFault(
                    self.link.device,
                    f"its name is {name!r}, the settings ask for {self.expected_name!r}",
                    "unplug the other unit, or correct the name in the settings",
                )
        except DeviceError:
            self.link.close()
            raise
        self._identity = Identity("Helios DAC", name, f"firmware {firmware}")
        self._shutter_open = False
        self._deaf_until = 0.0

    def close(self) -> None:
        """Stop, close the shutter and release the device, as far as the link allows."""
        if self.link.is_open:
            with contextlib.suppress(DeviceError):  # a lost device cannot be stopped from here
                self.stop()
            with contextlib.suppress(DeviceError):
                self.shutter(opened=False)
        self.link.close()

    def identify(self) -> Identity:
        """Get the model, the name in place of a serial number, and the firmware, as read at opening."""
        return self._identity

    def firmware_version(self) -> int:
        """Get the version of the firmware."""
        answer = self._ask(Command.FIRMWARE, Answer.FIRMWARE, 5, QUERY_S)
        return int.from_bytes(answer[1:5], "little")

    def name(self) -> str:
        """Get the name of the unit."""
        return wire.decode_name(self._ask(Command.NAME, Answer.NAME, 2, QUERY_S)[1:])

    def set_name(self, name: str) -> None:
        """Set the name of the unit (1 to 20 ASCII characters) and read it back.

        Raises
        ------
        LimitError
            When the name is empty, too long or not ASCII; nothing was sent.
        DeviceFault
            When the name read back differs.
        """
        try:
            data = wire.encode_name(name)
        except ValueError as error:
            raise LimitError(self.link.device, str(error)) from error
        self.link.write(wire.EP_COMMAND, data, timeout_s=STATUS_S)
        if (found := self.name()) != name:
            raise DeviceFault(self.link.device, f"name read back as {found!r} after setting {name!r}")

    def ready(self) -> bool:
        """Get whether the controller answers and has a buffer free for the next position."""
        return self._ask(Command.STATUS, Answer.STATUS, 2, STATUS_S)[1] != 0

    def move(self, x_code: int, y_code: int) -> None:
        """Send the beam to a position (integer codes from 0 to 4095 for each axis).

        Raises
        ------
        LimitError
            When a code is out of range; nothing was sent.
        Timeout
            When the controller has no free buffer within 1 s.
        """
        check_range(self.link.device, "x code", x_code, 0, wire.CODES - 1)
        check_range(self.link.device, "y code", y_code, 0, wire.CODES - 1)
        self._play(wire.point_frame(x_code, y_code))

    def play(self, xy: ArrayLike, marked: ArrayLike, rate_hz: int) -> None:
        """Send a path that is played once, with the marker (blue) line high at some of its points.

        Parameters
        ----------
        xy : (n, 2) array of int
            Codes from 0 to 4095; 1 to 4095 points.
        marked : (n,) array of bool
            Where the marker line is high; it falls at the end of the path.
        rate_hz : int
            Points per second, 7 to 65535.

        Raises
        ------
        LimitError
            When a value is out of range; nothing was sent.
        """
        try:
            frame = wire.path_frame(xy, marked, rate_hz)
        except ValueError as error:
            raise LimitError(self.link.device, f"{error}; nothing was sent") from error
        self._play(frame)

    def park(self) -> None:
        """Send the mirrors to the centre, wait until the frame has been played, and verify that it was.

        Raises
        ------
        DeviceFault
            When the controller is still busy afterwards.
        """
        self.stop()
        frame = wire.point_frame(wire.CENTRE, wire.CENTRE)
        self._play(frame)
        self.link.clock.sleep(len(frame.xy) / frame.rate_hz)
        if not self.ready():
            raise DeviceFault(self.link.device, "still busy after the mirrors were sent to the centre")

    def stop(self) -> None:
        """Stop playing: outputs dark at once, mirrors to the centre 100 ms later."""
        self._send(Command.STOP)
        self._deaf_until = self.link.clock.now() + STOP_S

    def shutter(self, *, opened: bool) -> None:
        """Control the shutter line; the device cannot read it back."""
        self._send(Command.SHUTTER, int(opened))
        self._shutter_open = opened

    def _play(self, frame: wire.GalvoFrame) -> None:
        clock = self.link.clock
        clock.sleep(self._deaf_until - clock.now())
        end = clock.now() + BUSY_LIMIT_S
        while not self.ready():
            if clock.now() >= end:
                raise Timeout(
                    self.link.device, f"no free buffer within {BUSY_LIMIT_S:g} s", "stop it, or switch it off and on"
                )
            clock.sleep(POLL_S)
        if not self._shutter_open:
            self.shutter(opened=True)
        data = wire.encode_frame(frame)
        self.link.write(wire.EP_FRAME, data, timeout_s=FRAME_TIMEOUT_S + len(data) / FRAME_BYTES_PER_S)

    def _send(self, command: Command, argument: int = 0) -> None:
        data = wire.encode_command(command, argument)
        try:
            self.link.write(wire.EP_COMMAND, data, timeout_s=STATUS_S)
        except Timeout:
            self.link.write(wire.EP_COMMAND, data, timeout_s=STATUS_S)

    def _ask(self, command: Command, answer: Answer, length: int, timeout_s: float) -> bytes:
        """Send a query, once more when no answer comes in time."""
        self._send(command)
        try:
            data = self._answer(answer, timeout_s)
        except Timeout:
            self._flush()
            self._send(command)
            data = self._answer(answer, timeout_s)
        if len(data) < length:
            raise ProtocolError(self.link.device, f"answer {data.hex(' ')} is shorter than {length} bytes")
        return data

    def _answer(self, answer: Answer, timeout_s: float) -> bytes:
        """Read until an answer of this kind comes; answers to earlier queries are dropped."""
        end = self.link.clock.now() + timeout_s
        while True:
            left_s = max(0.0, end - self.link.clock.now())
            data = self.link.read(wire.EP_ANSWER, wire.ANSWER_SIZE, timeout_s=left_s)
            if data[:1] == bytes([answer]):
                return data

    def _flush(self) -> None:
        """Read answers to earlier queries until none comes."""
        for _ in range(64):  # a unit holds a few at most; if they never end, the query that follows fails
            try:
                self.link.read(wire.EP_ANSWER, wire.ANSWER_SIZE, timeout_s=FLUSH_S)
            except Timeout:
                return
