"""`DiodeBlock`: laser diode, Peltier element and heat sink as two lumped heat capacities."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from drivers.clock import Clock
from sim.settings import SimulationSettings


class DiodeBlock:
    """Temperature of the laser diode; implements `sim.wires.HeatPump`.

    Block and sink obey ``C dT/dt = P + G (T_other - T)``, linear with constant input between two calls, so the state
    is carried forward exactly whenever somebody looks, whatever the interval. Half of the Joule heat of
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
        self._capacity = np.array([block, sink])
        self._exchange = np.array(
            [[-between / block, between / block], [between / sink, -(between + to_air) / sink]], dtype=np.float64
        )
        self._rates, self._modes = np.linalg.eig(self._exchange)
        self._into_modes = np.linalg.inv(self._modes)
        self._at_rest = -np.linalg.inv(self._exchange)
        self._degc = np.full(2, settings.ambient_degc)

    def heated_by(self, power_w: Callable[[], float]) -> None:
        """Tell the block what heats it besides the Peltier element: ``power_w()`` in W."""
        self._load = power_w

    def temperature_degc(self) -> float:
        """Get the temperature of the block (degC)."""
        self._carry_forward()
        return float(self._degc[0])

    def sink_degc(self) -> float:
        """Get the temperature of the heat sink (degC)."""
        self._carry_forward()
        return float(self._degc[1])

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
        power_w = np.array([joule_w / 2 + pumped_w + self._load(), joule_w / 2 - pumped_w])
        power_w[1] += self._settings.sink_conductance_w_per_k * self._settings.ambient_degc
        final_degc = self._at_rest @ (power_w / self._capacity)
        amplitudes = self._into_modes @ (self._degc - final_degc)
        self._degc = final_degc + self._modes @ (amplitudes * np.exp(self._rates * elapsed_s))


def _no_load() -> float:
    return 0.0
