"""`Subscribers`: stored lines handed on to viewers and consumers, none of which can hold the beam.

On a real clock each has a thread and a queue of its own, since the thread that scans also feeds the bridge's watchdog.
On a virtual clock, where time stands still while the computer works, they are called in line: a seed then repeats a
scan to the last bit.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from picoradar.instrument.controller.job import Sink
from picoradar.instrument.events import Log
from picoradar.instrument.line import ScanLine

VIEWER_QUEUE_LINES = 8  # a viewer further behind than this misses the oldest: it shows the present, not the past
VIEWER_WAIT_S = 1.0  # wall time for which the end of a scan, in the dark, waits for a viewer
STALL_S = 30.0  # wall time after which a consumer that finishes no line counts as hanging


@dataclass(frozen=True)
class Subscription:
    """One who gets the lines of a scan.

    Attributes
    ----------
    sink : callable
        Gets each line after it was stored.
    name : str
        For the outcome of the scan; by default that of the callable.
    every_line : bool
        True for a consumer that must see all lines: it may fall behind, and its queue grows with it; the end of the
        scan waits for it, without light. False for a viewer: it misses lines when it is too slow.
    """

    sink: Sink
    name: str = ""
    every_line: bool = False

    @property
    def label(self) -> str:
        """Get the name to show."""
        return self.name or str(getattr(self.sink, "__name__", type(self.sink).__name__))


@dataclass
class _Feed:
    """A subscription with its thread, its queue, and how far it has come."""

    subscription: Subscription
    log: Log
    waiting: deque[ScanLine] = field(default_factory=deque)
    put: int = 0
    seen: int = 0
    skipped: int = 0
    failure: str = ""
    over: bool = False
    changed: threading.Condition = field(default_factory=threading.Condition)

    def start(self) -> None:
        threading.Thread(target=self._serve, name=f"sink {self.subscription.label}", daemon=True).start()

    def add(self, line: ScanLine) -> None:
        with self.changed:
            self.put += 1
            if self.failure:
                return
            if not self.subscription.every_line and len(self.waiting) >= VIEWER_QUEUE_LINES:
                self.waiting.popleft()
                self.skipped += 1
            self.waiting.append(line)
            self.changed.notify_all()

    def call(self, line: ScanLine) -> None:
        """Hand one line over; a sink that raises is left out from then on.

        In line, what is no `Exception` ends the scan, as it would anywhere in it; in a thread of its own it is kept.
        """
        try:
            self.subscription.sink(line)
        except Exception as error:  # noqa: BLE001 - a viewer may fail in any way; the beam and the recording go on
            self._fail(line, error)
        else:
            self.seen += 1

    def finish(self, *, wait: bool) -> str:
        """Say that no more lines come, wait for what is still to be seen, and return the state in words."""
        wait_s = 0.0 if not wait else STALL_S if self.subscription.every_line else VIEWER_WAIT_S
        with self.changed:
            self.over = True
            self.changed.notify_all()
            while not self._done() and self.changed.wait_for(self._has_moved(), wait_s):
                pass
            return self._words()

    def _has_moved(self) -> Callable[[], bool]:
        before = self.seen
        return lambda: self.seen > before or self._done()

    def _done(self) -> bool:
        return bool(self.failure) or self.seen + self.skipped == self.put

    def _words(self) -> str:
        if self.failure:
            return f"failed after {self.seen} of {self.put} lines: {self.failure}"
        skipped = f", {self.skipped} skipped" if self.skipped else ""
        if not self._done():
            return f"hangs: {self.seen} of {self.put} lines seen{skipped}"
        return "complete" if not skipped else f"{self.seen} of {self.put} lines seen{skipped}"

    def _serve(self) -> None:
        while True:
            with self.changed:
                self.changed.wait_for(lambda: bool(self.waiting) or self.over)
                if not self.waiting:
                    return
                line = self.waiting.popleft()
            try:
                self.call(line)
            except BaseException as error:  # noqa: BLE001 - the end of this thread only
                self._fail(line, error)
            with self.changed:
                self.changed.notify_all()
                if self.failure:
                    return

    def _fail(self, line: ScanLine, error: BaseException) -> None:
        with self.changed:
            self.failure = repr(error)
            self.waiting.clear()
        self.log.error("sink failed and is left out", sink=self.subscription.label, line=line.index, error=self.failure)


class Subscribers:
    """All who get the lines of one scan.

    Parameters
    ----------
    sinks : sequence of callables or Subscription
        A bare callable is a viewer.
    in_line : bool
        Call them in the thread that scans.
    log : structlog logger
    """

    def __init__(self, sinks: Sequence[Sink | Subscription], log: Log, *, in_line: bool) -> None:
        whole = [sink if isinstance(sink, Subscription) else Subscription(sink) for sink in sinks]
        self._feeds = [_Feed(subscription, log) for subscription in whole]
        self._in_line = in_line
        if not in_line:
            for feed in self._feeds:
                feed.start()

    def take(self, line: ScanLine) -> None:
        """Hand a line on; returns at once on a real clock."""
        for feed in self._feeds:
            if not self._in_line:
                feed.add(line)
            else:
                feed.put += 1
                if not feed.failure:
                    feed.call(line)

    def finish(self) -> dict[str, str]:
        """Wait for those that must see every line, and return the state of each by its name."""
        states: dict[str, str] = {}
        for feed in self._feeds:
            name, number = feed.subscription.label, 2
            while name in states:
                name, number = f"{feed.subscription.label} {number}", number + 1
            states[name] = feed.finish(wait=not self._in_line)
        return states
