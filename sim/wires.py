"""The wires between the simulated devices: trigger, supply, command of the mirrors, and interlock chain.

The firmware of one device drives a wire; the physics and the firmware of others read it. Nothing here depends on a
protocol.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass
class TriggerLine:
    """Laser trigger pulses of the delay generator, before the gate of the sampling bridge.

    Attributes
    ----------
    rate_hz : float
        Pulses per second; 0 when there are none.
    """

    rate_hz: float = 0.0


@dataclass
class InterlockChain:
    """The loop through lid and key switch; connected devices are notified of each change."""

    _closed: bool = True
    _listeners: list[Callable[[], None]] = field(default_factory=list)

    @property
    def closed(self) -> bool:
        """Get whether the loop is closed (safe to emit)."""
        return self._closed

    @closed.setter
    def closed(self, closed: bool) -> None:
        if closed != self._closed:
            self._closed = closed
            for listener in self._listeners:
                listener()

    def on_change(self, listener: Callable[[], None]) -> None:
        """Call ``listener`` after each change."""
        self._listeners.append(listener)


class Supply(Protocol):
    """Output terminals of the drive supply."""

    def output_v(self) -> float:
        """Get the present voltage (V) at the pulser."""


class Mirrors(Protocol):
    """Analogue inputs of the galvo amplifier."""

    def command(self, x: float, y: float) -> None:
        """Take a new command now; ``x`` and ``y`` in -1..+1 of the analogue span."""


class HeatPump(Protocol):
    """Diode block with its Peltier element, seen from the temperature controller."""

    def temperature_degc(self) -> float:
        """Get the temperature at the object sensor (degC)."""

    def sink_degc(self) -> float:
        """Get the temperature at the heat sink (degC)."""

    def drive(self, current_a: float) -> None:
        """Set the current through the Peltier element (A, positive heats)."""


@dataclass(frozen=True)
class Acquisition:
    """One window of one record that the sampling bridge takes.

    Attributes
    ----------
    key : tuple of int
        Names the measurement for the noise streams: run id, how often this run was delivered
        before, record number, window number.
    start_s : float
        Clock time of the first shot of the window.
    prf_hz : float
        Shots per second.
    delay_ps, step_ps : float
        Sampling instant of the first sample after the trigger, and step from shot to shot.
    samples, sweeps, settle_shots : int
        Samples in a sweep, sweeps, and shots discarded before each sweep.
    gate_open : bool
        Whether triggers reach the laser.
    """

    key: tuple[int, int, int, int]
    start_s: float
    prf_hz: float
    delay_ps: float
    step_ps: float
    samples: int
    sweeps: int
    settle_shots: int
    gate_open: bool


class SignalSource(Protocol):
    """Photodiode, bridge and A/D, seen from the bridge's firmware."""

    def acquire(self, wanted: Acquisition) -> NDArray[np.uint32]:
        """Take one window and return the (samples,) sums of the 8-bit codes over its sweeps, with 0 and
        255 as the codes of a clipped sample.

        The firmware needs to know whether single samples were clipped: `clipped` says so for the last call.
        """

    @property
    def clipped(self) -> bool:
        """Get whether any single sample of the last window was clipped (code 0 or 255)."""
