"""One thread that serves sockets and ptys, and moves the bench's clock at a chosen pace.

The clock stays a `VirtualClock`: device time is exact, and waits for wall time instead of jumping. A transfer over the
simulated USB moves it ahead by its duration; the loop then lets wall time catch up. When the computer was slow the
clock does not jump but goes on from where it was: a host is never late because the simulation took time.
"""

from __future__ import annotations

import selectors
from collections.abc import Callable
from typing import Protocol

from picoradar.drivers.clock import ScaledClock, VirtualClock

STEP_S = 0.02  # of the bench's time; a computer that lags by more is slow
POLL_S = 0.1  # longest wait in wall time, so that a request to stop is noticed


class HasFileno(Protocol):
    """A socket, or a descriptor in an object."""

    def fileno(self) -> int:
        """Get the file descriptor."""


class EventLoop:
    """Runs callbacks when bytes come, and the timers of the clock when they are due.

    Parameters
    ----------
    clock : VirtualClock
        Time of the bench; nothing else may move it.
    speed : float
        Seconds of the bench per second of wall time.
    """

    def __init__(self, clock: VirtualClock, speed: float = 1.0) -> None:
        self.clock = clock
        self._pace = ScaledClock(speed)
        self._ahead_s = clock.now()  # clock over pace
        self._selector = selectors.DefaultSelector()
        self._pumps: list[Callable[[], None]] = []

    @property
    def speed(self) -> float:
        """Get the seconds of the bench per second of wall time."""
        return self._pace.factor

    def watch(self, source: HasFileno | int, ready: Callable[[], None]) -> None:
        """Call ``ready`` whenever ``source`` can be read."""
        self._selector.register(source, selectors.EVENT_READ, ready)

    def forget(self, source: HasFileno | int) -> None:
        """Stop watching ``source``; call this before closing it."""
        self._selector.unregister(source)

    def every_turn(self, pump: Callable[[], None]) -> None:
        """Call ``pump`` in every turn, after the clock has moved."""
        self._pumps.append(pump)

    def no_more(self, pump: Callable[[], None]) -> None:
        """Call ``pump`` no longer."""
        self._pumps.remove(pump)

    def turn(self) -> None:
        """Wait until bytes come or a timer is due (`POLL_S` at the most), and run what is due."""
        self._forgive_lag(STEP_S)
        idle_s = self._idle_s()
        came = self._selector.select(idle_s)
        self._forgive_lag(idle_s * self.speed + STEP_S)
        self.clock.advance_to(max(self._due_s(), self.clock.now()))
        for key, _ in came:
            if self._selector.get_map().get(key.fd) is key:  # another callback may have closed it
                key.data()
        for pump in list(self._pumps):
            pump()

    def catch_up(self) -> None:
        """Let wall time catch up with the clock, which a USB transfer has moved ahead by its duration."""
        self._pace.sleep(self.clock.now() - self._due_s())

    def close(self) -> None:
        """Stop watching all sources."""
        self._selector.close()

    def _due_s(self) -> float:
        """Get the time of the bench that corresponds to wall time."""
        return self._pace.now() + self._ahead_s

    def _idle_s(self) -> float:
        """Get for how long, in wall time, nothing is due."""
        due = self.clock.next_due()
        idle_s = POLL_S if due is None else (due - self._due_s()) / self.speed
        return min(max(0.0, idle_s), POLL_S)

    def _forgive_lag(self, allowed_s: float) -> None:
        """Drop the part of the lag of the clock behind wall time that exceeds the intended wait."""
        self._ahead_s -= max(0.0, self._due_s() - self.clock.now() - allowed_s)
