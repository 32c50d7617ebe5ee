"""Output stage of the simulated Genesys supply: soft start, discharge, load current.

A closed form in time, no timer: the voltage runs up with a fixed slope and falls with the time constant of the
output capacitor on its bleeder.
"""

from __future__ import annotations

import math

from picoradar.drivers.clock import Clock

SOFT_START_S = 0.25  # from 0 to rated voltage
DISCHARGE_S = 0.6
LOAD_OHM = 23.4e3  # bleeder and pulser


class Output:
    """The terminals.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    rated_v : float
        Rated voltage, for the slope of the soft start.
    """

    def __init__(self, clock: Clock, rated_v: float) -> None:
        self.clock = clock
        self.slope_v_per_s = rated_v / SOFT_START_S
        self._target_v = 0.0
        self._from_v = 0.0
        self._since = clock.now()

    def steer(self, target_v: float) -> None:
        """Run to another voltage from now on."""
        self._from_v = self.voltage_v()
        self._target_v = target_v
        self._since = self.clock.now()

    def voltage_v(self) -> float:
        """Get the voltage at the terminals now."""
        elapsed_s = self.clock.now() - self._since
        if self._from_v <= self._target_v:
            return min(self._target_v, self._from_v + self.slope_v_per_s * elapsed_s)
        return self._target_v + (self._from_v - self._target_v) * math.exp(-elapsed_s / DISCHARGE_S)
