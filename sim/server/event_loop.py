"""One thread that looks at sockets and ptys, and moves the bench's clock at a chosen pace.

The clock stays a `VirtualClock`: device time is exact, and waits for the wall instead of jumping. A transfer over the
simulated USB moves it ahead by the time that it takes; the loop then lets the wall catch up. When the
computer was slow the clock does not jump after the wall but goes on from where it was: the devices never find a host
late because their own simulation has taken time.
"""

from __future__ import annotations

import selectors
from collections.abc import Callable
from typing import Protocol

from picoradar.drivers.clock import ScaledClock, VirtualClock

STEP_S = 0.02  # of the bench's time; a computer that is later than this is slow
LOOK_S = 0.1  # longest wait (wall), so that a request to stop is seen


class HasFileno(Protocol):
    """A socket, or a descriptor in an object."""

    def fileno(self) -> int:
        """Get the file descriptor."""


class EventLoop:
    """Runs callbacks when bytes come, and the timers of the clock when they are due.

    Parameters
    ----------
    clock : VirtualClock
        Time of the bench; nobody else may move it.
    speed : float
        Seconds of the bench per second of the wall.
    """

    def __init__(self, clock: VirtualClock, speed: float = 1.0) -> None:
        self.clock = clock
        self._pace = ScaledClock(speed)
        self._ahead_s = clock.now()  # clock over pace
        self._selector = selectors.DefaultSelector()
        self._pumps: list[Callable[[], None]] = []

    @property
    def speed(self) -> float:
        """Get the seconds of the bench per second of the wall."""
        return self._pace.factor

    def watch(self, source: HasFileno | int, ready: Callable[[], None]) -> None:
        """Call ``ready`` whenever ``source`` can be read."""
        self._selector.register(source, selectors.EVENT_READ, ready)

    def forget(self, source: HasFileno | int) -> None:
        """SupplyState at ``source`` no more; call it before closing it."""
        self._selector.unregister(source)

    def every_turn(self, pump: Callable[[], None]) -> None:
        """Call ``pump`` in every turn, after the clock has moved."""
        self._pumps.append(pump)

    def turn(self) -> None:
        """Wait until bytes come or a timer is due (`LOOK_S` at the most), and do what there is to do."""
        self._forgive_lag(STEP_S)
        idle_s = self._idle_s()
        came = self._selector.select(idle_s)
        self._forgive_lag(idle_s * self.speed + STEP_S)
        self.clock.advance_to(max(self._due_s(), self.clock.now()))
        for key, _ in came:
            key.data()
        for pump in self._pumps:
            pump()

    def catch_up(self) -> None:
        """Let the wall catch up with the clock, which a USB transfer has moved ahead by the time that it takes."""
        self._pace.sleep(self.clock.now() - self._due_s())

    def close(self) -> None:
        """SupplyState at nothing any more."""
        self._selector.close()

    def _due_s(self) -> float:
        """Get the moment of the bench that the wall has reached."""
        return self._pace.now() + self._ahead_s

    def _idle_s(self) -> float:
        """Get how long (wall) nothing will be due."""
        due = self.clock.next_due()
        idle_s = LOOK_S if due is None else (due - self._due_s()) / self.speed
        return min(max(0.0, idle_s), LOOK_S)

    def _forgive_lag(self, allowed_s: float) -> None:
        """Take back what the wall is ahead of the clock by more than the loop has meant to wait."""
        self._ahead_s -= max(0.0, self._due_s() - self.clock.now() - allowed_s)
