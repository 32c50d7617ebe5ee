"""The taps between the physics and the devices: signal, mirrors, heat pump."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.sim.wires import Acquisition, HeatPump, InterlockChain, Mirrors, SignalSource

FOLLOW_S = 0.005
FOLLOW_LIMIT = 0.01  # of the span from centre to end: 0.05 deg


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

    The mirrors must be within 0.05 deg of their command 5 ms after a step, else the monitor opens the chain. Software
    cannot see the mirrors: without the monitor a stuck mirror would give wrong points.

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
        """Move the mirrors, on command or not."""
        self._sent = (x, y)
        self._mirrors.command(x, y)
        if self.change:  # an intact amplifier follows: there is nothing to monitor
            self._clock.call_at(self._clock.now() + FOLLOW_S, self._monitor)

    @property
    def wanted(self) -> tuple[float, float]:
        """Get the last command to the mirrors."""
        return self._wanted

    def _monitor(self) -> None:
        if max(abs(a - b) for a, b in zip(self._wanted, self._sent, strict=True)) > FOLLOW_LIMIT:
            self._interlock.closed = False


class HeatPumpTap:
    """Between temperature controller and diode block.

    Attributes
    ----------
    forced_a : float, optional
        Current that flows whatever the controller commands.
    sensor_degc : float, optional
        Reading of the sensor, whatever the temperature is.
    """

    def __init__(self, block: HeatPump) -> None:
        self._block = block
        self.forced_a: float | None = None
        self.sensor_degc: float | None = None
        self._commanded_a = 0.0

    def temperature_degc(self) -> float:
        """Get the reading of the object sensor."""
        return self._block.temperature_degc() if self.sensor_degc is None else self.sensor_degc

    def sink_degc(self) -> float:
        """Get the temperature of the heat sink."""
        return self._block.sink_degc()

    def drive(self, current_a: float) -> None:
        """Set the current through the Peltier element."""
        self._commanded_a = current_a
        self.apply()

    def apply(self) -> None:
        """Set the forced current, or else the commanded one."""
        self._block.drive(self._commanded_a if self.forced_a is None else self.forced_a)
