"""Oscilloscope and power meter at the laser, for the bench procedure `transmitter`."""

from __future__ import annotations

from typing import Any

from drivers.clock import Clock
from drivers.interfaces import Record, SweepSettings
from drivers.oscilloscope import Oscilloscope, oscilloscope_link
from drivers.usbtmc import Usbtmc
from instrument.cli.simulated import Simulated


class SimulatedLightMeters:
    """The simulated oscilloscope with a fast detector at its input, through its own driver; and a power meter."""

    def __init__(self, simulated: Simulated) -> None:
        from sim.firmware.oscilloscope import OscilloscopeFirmware
        from sim.laser_monitor import LaserMonitor
        from sim.usb.backend import SimUsbBackend

        bench = simulated.bench

        def gate_open() -> bool:
            return bench.bridge.gate_open

        self._monitor = LaserMonitor(bench.settings, bench.noise, bench.trigger, bench.genesys, bench.block, gate_open)
        firmware = OscilloscopeFirmware(bench.clock, bench.trigger, self._monitor, gate_open=gate_open)
        self._scope = _scope(bench.clock, SimUsbBackend(bench.clock, [firmware]))

    def open(self) -> None:
        """Open the oscilloscope."""
        self._scope.open()

    def close(self) -> None:
        """Close it."""
        self._scope.close()

    def trace(self, sweep: SweepSettings) -> Record:
        """Take one averaged trace of the laser pulse."""
        self._scope.configure(sweep)
        return self._scope.take(1)[0]

    def mean_power_mw(self) -> float:
        """Read the power meter."""
        return self._monitor.mean_power_mw()


def _scope(clock: Clock, backend: Any) -> Oscilloscope:
    return Oscilloscope(Usbtmc(oscilloscope_link(clock, backend=backend)), full_scale_v=0.24, offset_v=0.05)
