"""`DiodeBlock`: laser diode, Peltier element and heat sink as two lumped heat capacities."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from picoradar.drivers.clock import Clock
from picoradar.sim.settings import SimulationSettings


class DiodeBlock:
    """Temperature of the laser diode; implements `picoradar.sim.wires.HeatPump`.

    Block and sink obey ``C dT/dt = P + G (T_other - T)``, linear with constant input between two calls, so that the
    state is carried forward exactly at each reading, whatever the interval. Half of the Joule heat of
    the Peltier element goes to each of its sides; what it pumps into the block it takes from the sink.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    settings : SimulationSettings
        Heat capacities, conductances, Peltier element and ambient temperature.
    """

    def __init__(self, clock: Clock, settings: SimulationSettings) -> None:
        self._clock = clock
        self._settings = settings
        self._current_a = 0.0
        self._load: Callable[[], float] = _no_load
        self._then_s = clock.now()
        block, sink = settings.block_capacity_j_per_k, settings.sink_capacity_j_per_k
        between, to_air = settings.block_conductance_w_per_k, settings.sink_conductance_w_per_k
        exchange = np.array(
            [[-between / block, between / block], [between / sink, -(between + to_air) / sink]], dtype=np.float64
        )
        rates, modes = np.linalg.eig(exchange)
        # Plain numbers: several times as fast as arrays of two.
        self._rates: list[float] = rates.tolist()
        self._modes: list[list[float]] = modes.tolist()
        self._amplitudes_per_j: list[list[float]] = (np.linalg.inv(modes) / np.array([block, sink])).tolist()
        self._amplitudes: list[float] = (np.linalg.inv(modes) @ np.full(2, settings.ambient_degc)).tolist()

    def heated_by(self, power_w: Callable[[], float]) -> None:
        """Set what heats the block besides the Peltier element: ``power_w()`` in W."""
        self._load = power_w

    def temperature_degc(self) -> float:
        """Get the temperature of the block (degC)."""
        self._carry_forward()
        return self._degc(0)

    def sink_degc(self) -> float:
        """Get the temperature of the heat sink (degC)."""
        self._carry_forward()
        return self._degc(1)

    def drive(self, current_a: float) -> None:
        """Set the current through the Peltier element (A, positive heats the block)."""
        self._carry_forward()
        self._current_a = current_a

    def _carry_forward(self) -> None:
        now_s = self._clock.now()
        elapsed_s = now_s - self._then_s
        if elapsed_s <= 0:
            return
        self._then_s = now_s
        pumped_w = self._settings.peltier_w_per_a * self._current_a
        joule_w = self._settings.peltier_ohm * self._current_a**2
        into_block_w = joule_w / 2 + pumped_w + self._load()
        air_w = self._settings.sink_conductance_w_per_k * self._settings.ambient_degc
        into_sink_w = joule_w / 2 - pumped_w + air_w
        for k, (rate, (of_block, of_sink)) in enumerate(zip(self._rates, self._amplitudes_per_j, strict=True)):
            final = -(of_block * into_block_w + of_sink * into_sink_w) / rate
            self._amplitudes[k] = final + (self._amplitudes[k] - final) * math.exp(rate * elapsed_s)

    def _degc(self, body: int) -> float:
        one, other = self._modes[body]
        return one * self._amplitudes[0] + other * self._amplitudes[1]


def _no_load() -> float:
    return 0.0
