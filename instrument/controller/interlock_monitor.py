"""`InterlockMonitor`: which interlocks hold the run now, and since when."""

from __future__ import annotations

from dataclasses import dataclass

from picoradar.drivers.clock import Clock
from picoradar.instrument.controller.interlocks import Interlock, Readings
from picoradar.instrument.errors import InterlockTripped


@dataclass
class _InterlockState:
    """One interlock: outside its band since when, tripped or not, and in which words."""

    interlock: Interlock
    outside_since_s: float | None = None
    tripped: bool = False
    words: str = ""

    def take(self, value: float, now_s: float) -> None:
        if self.interlock.holds(value, tripped=self.tripped):
            self.clear()
            return
        if self.outside_since_s is None:
            self.outside_since_s = now_s
        self.words = self.interlock.describe(value)
        self.tripped = self.tripped or now_s - self.outside_since_s >= self.interlock.hold_off_s

    def clear(self) -> None:
        self.outside_since_s, self.tripped, self.words = None, False, ""


class InterlockMonitor:
    """Judges readings by the table of interlocks; remembers what hysteresis and hold-off need.

    Parameters
    ----------
    table : tuple of Interlock
    clock : Clock
    """

    def __init__(self, table: tuple[Interlock, ...], clock: Clock) -> None:
        self._states = [_InterlockState(interlock) for interlock in table]
        self._clock = clock

    def why(self) -> list[str]:
        """Get what holds the run now, each with value, band and what to do; empty when all is well."""
        return [f"{state.interlock.name}: {state.words}" for state in self._states if state.tripped]

    def judge(self, readings: Readings, *, emitting: bool) -> None:
        """Take readings; raise for the gravest interlock that they show not to hold.

        Raises
        ------
        InterlockTripped
            With its ``action``; ``off`` before ``abort`` before ``suspend``.
        """
        now_s = self._clock.now()
        judged = []
        for state in self._states:
            value = state.interlock.quantity(readings)
            if state.interlock.emitting_only and not emitting:
                state.clear()
            elif value is not None:
                state.take(value, now_s)
                judged.append(state)
        for action in ("off", "abort", "suspend"):
            for state in judged:
                if state.tripped and state.interlock.action == action:
                    raise InterlockTripped(state.interlock.name, state.words, action=action)

    def clear(self) -> None:
        """Forget everything, for a new run."""
        for state in self._states:
            state.clear()
