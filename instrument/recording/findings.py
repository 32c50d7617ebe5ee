"""What a recording tells beside its lines."""

from __future__ import annotations

from dataclasses import dataclass

from picoradar.instrument.events import JsonObject


@dataclass(frozen=True)
class Event:
    """What happened during a scan: a change of state, an alarm, a read-back."""

    time_s: float
    kind: str
    state: str | None
    fields: JsonObject


@dataclass(frozen=True)
class LineCheck:
    """Whether a line can be relied on; `problem` says what is wrong."""

    index: int
    problem: str = ""

    @property
    def ok(self) -> bool:
        """Get whether the line is whole."""
        return not self.problem
