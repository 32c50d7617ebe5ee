"""`InjectionSchedule`: decides, message by message, whether a fault is injected now."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from picoradar.drivers.clock import Clock
from picoradar.sim.faults.fault import Fault


class InjectionSchedule:
    """Counts the messages on a link and decides at which of them a fault is injected.

    Parameters
    ----------
    fault : Fault
    clock : Clock
    shots : callable
        Gets the laser shots sampled so far.
    rng : numpy.random.Generator
        For faults by probability.

    Attributes
    ----------
    first_s : float or None
        When the fault was first injected.
    """

    def __init__(self, fault: Fault, clock: Clock, shots: Callable[[], int], rng: np.random.Generator) -> None:
        self._fault = fault
        self._clock = clock
        self._shots = shots
        self._rng = rng
        self._seen = 0
        self._left = fault.count if fault.count is not None else (None if fault.lasts_s is not None else 1)
        if fault.at.probability is not None and fault.count is None:
            self._left = None
        self.first_s: float | None = None

    def hits(self) -> bool:
        """Count one message, and decide whether the fault affects it."""
        self._seen += 1
        if self._left == 0 or not self._due():
            return False
        now_s = self._clock.now()
        if self.first_s is None:
            self.first_s = now_s
        if self._fault.lasts_s is not None and now_s > self.first_s + self._fault.lasts_s:
            self._left = 0
            return False
        if self._left is not None:
            self._left -= 1
        return True

    def _due(self) -> bool:
        at = self._fault.at
        if at.time_s is not None:
            return self._clock.now() >= at.time_s
        if at.command is not None:
            return self._seen >= at.command
        if at.pulse is not None:
            return self._shots() >= at.pulse
        return bool(self._rng.random() < (at.probability or 0.0))
