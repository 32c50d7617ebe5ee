"""One link of a transcript: its events in order, and the host's progress through them."""

from __future__ import annotations

from collections.abc import Sequence

from picoradar.drivers.links import Event


class ReplayMismatch(Exception):
    """The host did something that is not in the transcript."""


class Script:
    """The events of one link in order, and the host's progress through them.

    Parameters
    ----------
    events : sequence of Event
        A transcript.
    link : str
        Which of its links.
    kinds : tuple of str
        Kinds of events that a device takes part in.

    Attributes
    ----------
    opened : Event
        How the link was opened.
    last_s : float
        Time in the transcript of the last event that was played.
    """

    def __init__(self, events: Sequence[Event], link: str, kinds: tuple[str, ...]) -> None:
        self.opened = next(e for e in events if e.link == link and e.what == "open")
        self._events = [e for e in events if e.link == link and e.what in kinds]
        self._link = link
        self._done = 0
        self.last_s = self.opened.time_s

    @property
    def finished(self) -> bool:
        """Get whether the transcript has been played to its end."""
        return self._done == len(self._events)

    def next(self, what: str) -> Event | None:
        """Get the next event if it is of this kind."""
        event = None if self.finished else self._events[self._done]
        return event if event is not None and event.what == what else None

    def expect(self, what: str, came: str) -> Event:
        """Get the next event, which has to be of this kind."""
        event = self.next(what)
        if event is None:
            due = "nothing more" if self.finished else _described(self._events[self._done])
            raise ReplayMismatch(f"{self._link}, event {self._done + 1}: the transcript has {due}, the host did {came}")
        return event

    def refuse(self, came: str) -> ReplayMismatch:
        """Make the error of an event whose content differs."""
        due = _described(self._events[self._done])
        return ReplayMismatch(f"{self._link}, event {self._done + 1}: the transcript has {due}, the host did {came}")

    def pass_on(self) -> None:
        """Go on to the next event."""
        self.last_s = self._events[self._done].time_s
        self._done += 1


def _described(event: Event) -> str:
    where = f" on endpoint {event.more['endpoint']:#04x}" if "endpoint" in event.more else ""
    return f"{event.what} {event.data!r}{where} at {event.time_s:g} s"
