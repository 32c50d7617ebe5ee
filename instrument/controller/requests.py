"""What people and signals ask of a run: a queue that any thread may fill and one thread empties."""

from __future__ import annotations

import queue
from typing import Literal

from picoradar.instrument.errors import InterlockTripped

Request = Literal["finish", "registered", "pause", "resume", "abort", "interrupt", "emergency off"]
AFTER_LINE: dict[str, str] = {"finish": "finished early", "registered": "registered"}
"""Reasons of the ends that come after a whole line, with the laser still on to check the range zero."""
REASONS: dict[str, str] = {"abort": "aborted", "interrupt": "interrupted", **AFTER_LINE}


class EndScan(Exception):
    """Leave the scanning loop here, for the reason given."""


class Requests:
    """The queue, and what each request means at a point, between two lines, and while the laser is off."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Request] = queue.SimpleQueue()

    def put(self, what: Request) -> None:
        """Ask; returns at once, from any thread or signal handler."""
        self._queue.put(what)

    def waiting(self) -> bool:
        """Get whether something was asked for."""
        return not self._queue.empty()

    def at_point(self) -> None:
        """Obey what cannot wait for the end of the line; the rest stays in the queue.

        Raises
        ------
        EndScan
            For ``abort`` and ``interrupt``.
        InterlockTripped
            For ``emergency off``.
        """
        for asked in self._take():
            self._obey(asked)
            if asked != "resume":  # nothing rests at a point
                self.put(asked)

    def at_line(self) -> bool:
        """Obey everything; returns whether a pause was asked for.

        Raises
        ------
        EndScan, InterlockTripped
            As `at_point`, and `EndScan` for ``finish`` and ``registered``.
        """
        asked = self._obeyed()
        return "pause" in asked and "resume" not in asked[asked.index("pause") :]

    def at_rest(self) -> bool:
        """Obey what was asked while the laser is off; returns whether to go on.

        Raises
        ------
        EndScan, InterlockTripped
            As `at_line`.
        """
        return "resume" in self._obeyed()

    def raise_emergency(self) -> None:
        """Obey an emergency off and leave everything else in the queue; for the end of a scan, which goes on anyhow.

        Raises
        ------
        InterlockTripped
        """
        asked = self._take()
        for what in asked:
            if what == "emergency off":
                self._obey(what)
            self.put(what)

    def clear(self) -> None:
        """Forget what was asked for, once nothing is left that it could stop."""
        self._take()

    def stop_asked(self) -> bool:
        """Get whether any way to end was asked for; for work without light.

        Raises
        ------
        InterlockTripped
            For ``emergency off``.
        """
        try:
            self.at_rest()
        except EndScan:
            return True
        return False

    def forget(self, what: Request) -> None:
        """Take every request of a kind out of the queue."""
        for asked in self._take():
            if asked != what:
                self.put(asked)

    def _obeyed(self) -> list[Request]:
        """Empty the queue, obey what ends a scan, and return what was asked."""
        asked = self._take()
        for what in asked:
            self._obey(what)
        for what in asked:
            if what in AFTER_LINE:
                raise EndScan(AFTER_LINE[what])
        return asked

    def _take(self) -> list[Request]:
        """Empty the queue; an emergency off is obeyed before whatever was asked for earlier."""
        asked = [self._queue.get() for _ in range(self._queue.qsize())]
        return sorted(asked, key=lambda what: what != "emergency off")

    @staticmethod
    def _obey(asked: Request) -> None:
        if asked == "emergency off":
            raise InterlockTripped("emergency off", "asked for by the operator; acknowledge to go on", action="off")
        if asked in ("abort", "interrupt"):
            raise EndScan(REASONS[asked])
