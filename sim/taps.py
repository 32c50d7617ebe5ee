"""Taps: what sits between two parts of the bench and hands everything on, until a fault is hung into it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.sim.ports import SerialFirmware
from picoradar.sim.usb import Setup, UsbFirmware, errors
from picoradar.sim.wires import Acquisition, HeatPump, InterlockChain, Mirrors, SignalSource

Pieces = list[tuple[bytes, float]]
CONTROL_TIMEOUT_S = 0.5
FOLLOW_S = 0.005
FOLLOW_LIMIT = 0.01  # of the span from centre to end: 0.05 deg


def _nobody(_data: bytes, _delay_s: float) -> None:
    """Where answers go while no line is there."""


class SerialTap:
    """Between a serial line and the firmware of its device.

    Attributes
    ----------
    to_device : list of callables
        ``hook(data)`` returns what the device hears instead.
    to_host : list of callables
        ``hook(data, delay_s)`` returns the pieces ``(data, delay_s)`` that go on the line instead.
    """

    def __init__(self, firmware: SerialFirmware) -> None:
        self.firmware = firmware
        self.to_device: list[Callable[[bytes], bytes]] = []
        self.to_host: list[Callable[[bytes, float], Pieces]] = []
        self._send: Callable[[bytes, float], None] = _nobody

    @property
    def baud(self) -> int:
        """Get the device's baud rate."""
        return self.firmware.baud

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send
        self.firmware.connect(self._answer)

    def receive(self, data: bytes) -> None:
        """Hand bytes of the host on."""
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


class UsbTap:
    """Between the bus and the firmware of a USB device; itself such a firmware.

    Attributes
    ----------
    before : list of callables
        ``hook(setup)`` is called before each control request and may raise what the bus raises.
    ignored : list of callables
        ``hook(setup, data)`` tells whether the device does nothing at this request, and says so to nobody.
    answers : list of callables
        ``hook(setup, answer)`` returns what the host gets instead.
    silent : bool
        The device answers nothing at all.
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
        """Hand a request on."""
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
        """Hand an OUT transfer on."""
        return not self.silent and self.firmware.receive(endpoint, data)

    def take(self, endpoint: int) -> bytes | None:
        """Hand an IN transfer on."""
        return None if self.silent else self.firmware.take(endpoint)

    def configured(self, value: int) -> None:
        """Hand SET_CONFIGURATION on."""
        self.firmware.configured(value)

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """Hand SET_INTERFACE on."""
        self.firmware.alternate_selected(interface, alternate)

    def halt_cleared(self, endpoint: int) -> None:
        """Hand CLEAR_FEATURE on."""
        self.firmware.halt_cleared(endpoint)

    def bus_reset(self) -> None:
        """Hand a reset, or the loss of the bus, on."""
        self.firmware.bus_reset()


class SignalTap:
    """Between optics and bridge.

    Attributes
    ----------
    before : list of callables
        ``hook(wanted)`` returns the `Acquisition` that is carried out instead.
    after : list of callables
        ``hook(sums, wanted)`` returns the sums that the bridge gets instead.
    shots : int
        Laser shots sampled so far.
    """

    def __init__(self, source: SignalSource) -> None:
        self._source = source
        self.before: list[Callable[[Acquisition], Acquisition]] = []
        self.after: list[Callable[[NDArray[np.uint32], Acquisition], NDArray[np.uint32]]] = []
        self.shots = 0
        self._clipped = False

    def acquire(self, wanted: Acquisition) -> NDArray[np.uint32]:
        """Take one window."""
        self.shots += wanted.sweeps * (wanted.settle_shots + wanted.samples)
        done = wanted
        for change in self.before:
            done = change(done)
        sums = self._source.acquire(done)
        self._clipped = self._source.clipped
        for corrupt in self.after:
            sums = corrupt(sums, wanted)
            self._clipped = self._clipped or bool((sums == 255 * wanted.sweeps).any())
        return sums

    @property
    def clipped(self) -> bool:
        """Get whether any sample of the last window was clipped."""
        return self._clipped

    def dark(self, wanted: Acquisition) -> Acquisition:
        """Get the same window without light."""
        return replace(wanted, gate_open=False)


class MirrorsTap:
    """Between DAC and mirrors, with the scan-fail monitor of the galvo amplifier in the interlock chain.

    5 ms after a step the mirrors must be within 0.05 deg of where they were sent, else it opens the chain. No software
    sees the mirrors: without it a stuck mirror would give wrong points.

    Attributes
    ----------
    change : list of callables
        ``hook(x, y)`` returns where the mirrors are sent instead.
    """

    def __init__(self, mirrors: Mirrors, clock: Clock, interlock: InterlockChain) -> None:
        self._mirrors = mirrors
        self._clock = clock
        self._interlock = interlock
        self.change: list[Callable[[float, float], tuple[float, float]]] = []
        self._wanted = self._sent = (0.0, 0.0)

    def command(self, x: float, y: float) -> None:
        """Take a new command."""
        self._wanted = (x, y)
        for hook in self.change:
            x, y = hook(x, y)
        self.deflect(x, y)

    def deflect(self, x: float, y: float) -> None:
        """Move the mirrors, asked or not."""
        self._sent = (x, y)
        self._mirrors.command(x, y)
        if self.change:  # a sound amplifier follows: nothing to watch
            self._clock.call_at(self._clock.now() + FOLLOW_S, self._watch)

    @property
    def wanted(self) -> tuple[float, float]:
        """Get where the mirrors were sent last."""
        return self._wanted

    def _watch(self) -> None:
        if max(abs(a - b) for a, b in zip(self._wanted, self._sent, strict=True)) > FOLLOW_LIMIT:
            self._interlock.closed = False


class HeatPumpTap:
    """Between temperature controller and diode block.

    Attributes
    ----------
    forced_a : float, optional
        Current that flows whatever the controller asks for.
    sensor_degc : float, optional
        What the sensor reads whatever the temperature is.
    """

    def __init__(self, block: HeatPump) -> None:
        self._block = block
        self.forced_a: float | None = None
        self.sensor_degc: float | None = None
        self._asked_a = 0.0

    def temperature_degc(self) -> float:
        """Get the reading of the object sensor."""
        return self._block.temperature_degc() if self.sensor_degc is None else self.sensor_degc

    def sink_degc(self) -> float:
        """Get the temperature of the heat sink."""
        return self._block.sink_degc()

    def drive(self, current_a: float) -> None:
        """Set the current through the Peltier element."""
        self._asked_a = current_a
        self.apply()

    def apply(self) -> None:
        """Let the asked or the forced current flow."""
        self._block.drive(self._asked_a if self.forced_a is None else self.forced_a)
