"""Time for drivers, controller and simulator: wall, scaled or virtual.

No other module calls ``time.sleep`` or ``time.time``. Timers are cooperative: they run in the thread that sleeps or
waits on the clock, never in another one. On a `VirtualClock` time jumps from timer to timer, so that a warm-up of
20 min takes only as long as the computer needs. The heartbeat of the laser gate is such a timer: a host that hangs
anywhere stops feeding the watchdog.
"""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable

POLL_S = 0.01


class Timer:
    """A call that is due at a given time; `cancel` revokes it."""

    __slots__ = ("callback", "cancelled", "due", "period")

    def __init__(self, due: float, callback: Callable[[], None], period: float | None) -> None:
        self.due = due
        self.callback = callback
        self.period = period
        self.cancelled = False

    def cancel(self) -> None:
        """Revoke the call; harmless when it has run already."""
        self.cancelled = True


@runtime_checkable
class Clock(Protocol):
    """Time for drivers, controller and simulator (seconds, float)."""

    @property
    def real_time(self) -> bool:
        """Get whether time passes while the program computes; on a virtual clock it does not."""

    def now(self) -> float:
        """Get the seconds since an arbitrary start; never runs backwards."""

    def sleep(self, seconds: float) -> None:
        """Let ``seconds`` pass; timers that fall due meanwhile are run."""

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Let time pass until ``condition()`` holds; False if it does not within ``timeout`` seconds."""

    def call_at(self, when: float, callback: Callable[[], None]) -> Timer:
        """Run ``callback`` once at the time ``when``."""

    def every(self, period: float, callback: Callable[[], None]) -> Timer:
        """Run ``callback`` each ``period`` seconds, first after one period; missed calls are not made up for."""

    def run_due(self) -> None:
        """Run the timers that are due now; returns at once if there are none."""

    def port_wait_s(self, seconds: float) -> float:
        """Convert a time limit of this clock into one for a serial port.

        A port of the operating system counts wall time; the ports of a bench on a virtual clock count virtual time.
        """

    def patience_s(self, seconds: float) -> float:
        """Convert the time after which a peer counts as dead, in wall time, into seconds of this clock.

        On a scaled clock devices run faster but computers do not: such a limit keeps its length in wall time.
        """


class _Timers:
    """The heap of timers that all clocks share."""

    def __init__(self) -> None:
        # Tuples are compared much faster than objects; the number keeps timers with the same due time in order.
        self._heap: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()

    def now(self) -> float:
        raise NotImplementedError

    def call_at(self, when: float, callback: Callable[[], None]) -> Timer:
        return self._push(Timer(when, callback, None))

    def every(self, period: float, callback: Callable[[], None]) -> Timer:
        if not period > 0:
            raise ValueError(f"period must be positive, not {period}")
        return self._push(Timer(self.now() + period, callback, period))

    def run_due(self) -> None:
        """Run the timers that are due now."""
        while (timer := self._pop_due(self.now())) is not None:
            self._run(timer)

    def _push(self, timer: Timer) -> Timer:
        heapq.heappush(self._heap, (timer.due, next(self._order), timer))
        return timer

    def _next_due(self) -> float | None:
        heap = self._heap
        while heap and heap[0][2].cancelled:
            heapq.heappop(heap)
        return heap[0][0] if heap else None

    def _pop_due(self, now: float) -> Timer | None:
        due = self._next_due()
        return heapq.heappop(self._heap)[2] if due is not None and due <= now else None

    def _run(self, timer: Timer) -> None:
        # A periodic timer is armed again after its call, so that it can never nest in itself.
        timer.callback()
        if timer.period is not None and not timer.cancelled:
            timer.due = max(timer.due + timer.period, self.now())
            self._push(timer)


class ScaledClock(_Timers):
    """Wall time, ``factor`` times as fast.

    Parameters
    ----------
    factor : float
        Seconds of the clock per second of wall time; positive.
    """

    real_time = True

    def __init__(self, factor: float = 1.0) -> None:
        if not 0 < factor < float("inf"):
            raise ValueError(f"factor must be positive and finite, not {factor}")
        super().__init__()
        self.factor = factor
        self._start = time.monotonic()

    def now(self) -> float:
        return (time.monotonic() - self._start) * self.factor

    def port_wait_s(self, seconds: float) -> float:
        return seconds / self.factor

    def patience_s(self, seconds: float) -> float:
        return seconds * max(1.0, self.factor)

    def sleep(self, seconds: float) -> None:
        end = self.now() + seconds
        while True:
            self.run_due()
            left = end - self.now()
            if left <= 0:
                return
            due = self._next_due()
            if due is not None:
                left = min(left, due - self.now())
            if left > 0:
                time.sleep(left / self.factor)

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        end = self.now() + timeout
        while not condition():
            left = end - self.now()
            if left <= 0:
                return False
            self.sleep(min(left, POLL_S * max(1.0, self.factor)))
        return True


class VirtualClock(_Timers):
    """Discrete-event time: jumps from timer to timer, single-threaded, exact and repeatable.

    Parameters
    ----------
    speed : float, optional
        Largest number of seconds of the clock per second of wall time, to watch a simulation at a human pace.
        None (the default) runs as fast as the computer can.
    """

    real_time = False

    def __init__(self, speed: float | None = None) -> None:
        if speed is not None and not 0 < speed < float("inf"):
            raise ValueError(f"speed must be positive and finite, not {speed}")
        super().__init__()
        self._now = 0.0
        self._speed = speed
        self._wall_start = time.monotonic()

    def now(self) -> float:
        return self._now

    def port_wait_s(self, seconds: float) -> float:
        return seconds

    def patience_s(self, seconds: float) -> float:
        return seconds

    def next_due(self) -> float | None:
        """Get the due time of the next timer; None when there is none."""
        return self._next_due()

    def advance_to(self, moment: float) -> None:
        """Move to ``moment`` (or stay, if it has passed), running what falls due on the way.

        May be called from a timer's callback: time then moves on inside the outer call, which ends later than it
        meant to, as on a busy computer.
        """
        while (due := self._next_due()) is not None and due <= moment:
            timer = heapq.heappop(self._heap)[2]
            self._jump(due)
            self._run(timer)
        self._jump(moment)

    def sleep(self, seconds: float) -> None:
        self.advance_to(self._now + max(0.0, seconds))

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        end = self._now + timeout
        while not condition():
            due = self._next_due()
            if due is None and end == float("inf"):
                raise RuntimeError("endless wait: nothing that could end it is due on the virtual clock")
            if due is None or due > end:
                self.advance_to(end)
                return condition()
            self.advance_to(due)
        return True

    def _jump(self, moment: float) -> None:
        if moment <= self._now:
            return
        self._now = moment
        if self._speed is not None:
            ahead = moment / self._speed - (time.monotonic() - self._wall_start)
            if ahead > 0:
                time.sleep(ahead)
