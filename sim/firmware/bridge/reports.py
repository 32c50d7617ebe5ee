"""Error queue and events of the sampling bridge.

Source: protocol sheet ``sampling_bridge.md``, sections 2 (GET_ERROR) and 4.
"""

from __future__ import annotations

from collections import deque

from picoradar.drivers.bridge.sbp import ErrorCode, ErrorEntry, Event, EventKind
from picoradar.drivers.clock import Clock

ERRORS_MAX = 16
EVENTS_MAX = 32


class Reports:
    """Errors and events that the device reports by itself.

    Parameters
    ----------
    clock : Clock
        Time of the bench.

    Attributes
    ----------
    run_id : int
        Run that the events carry.
    """

    def __init__(self, clock: Clock) -> None:
        self.run_id = 0
        self._clock = clock
        self._started = clock.now()
        self._errors: deque[ErrorEntry] = deque()
        self._events: deque[bytes] = deque(maxlen=EVENTS_MAX)  # of unread events the latest are kept

    def __len__(self) -> int:
        """Get the number of errors queued."""
        return len(self._errors)

    def error(self, code: ErrorCode, detail: int = 0, *, request: int = 0) -> None:
        """Queue an error; in a full queue the last entry becomes QUEUE_FULL."""
        if len(self._errors) < ERRORS_MAX:
            self._errors.append(ErrorEntry(code, request, 0, detail))
        else:
            self._errors[-1] = ErrorEntry(ErrorCode.QUEUE_FULL, request, 0, detail)
        self.event(EventKind.ERROR, 0, code)

    def pop_error(self) -> ErrorEntry:
        """Take the oldest error; code 0 when there is none."""
        if not self._errors:
            return ErrorEntry(ErrorCode.OK, 0, 0, 0)
        entry = self._errors.popleft()
        return ErrorEntry(entry.code, entry.request, len(self._errors), entry.detail)

    def event(self, kind: EventKind, argument: int = 0, code: ErrorCode = ErrorCode.OK) -> None:
        """Send an event."""
        time_ms = round((self._clock.now() - self._started) * 1000) & 0xFFFFFFFF
        self._events.append(Event(kind, code, self.run_id, argument, time_ms).encode())

    def pop_event(self) -> bytes | None:
        """Take the oldest event."""
        return self._events.popleft() if self._events else None

    def clear(self) -> None:
        """Drop all errors and events."""
        self._errors.clear()
        self._events.clear()
