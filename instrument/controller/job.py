"""What a scan asks of the controller, and what it gets back."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from picoradar.drivers.interfaces import Galvo, Sampler
from picoradar.instrument.controller.safety import SafeState
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import Flag, ScanLine, ZeroReading

Sink = Callable[[ScanLine], None]
Between = Callable[[], None]
STATE_EVENT = "memory"
"""Kind of the event that carries `ScanJob.state_dict`; the name is part of the file format (docs/recording.md)."""
SUPERVISION = "supervision"
"""Key in it of how long ago which device was polled: the polls between two lines hold the mirrors."""


class ScanJob(Protocol):
    """Lines and how they are taken; knows nothing of states or safety."""

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler how records are taken."""

    @property
    def rows(self) -> Sequence[int]:
        """Get the rows to take, in order."""

    @property
    def line_bytes(self) -> int:
        """Get the most that one line takes on the disk."""

    @property
    def reference(self) -> tuple[float, float | None]:
        """Get the lowest amplitude (mV) and median instant (ps) of the reference in the last line; 0 and None: none."""

    def state_dict(self) -> JsonObject:
        """Get what the next line needs to know of those before, as plain data; empty for nothing."""

    def goes_on_at(self, row: int) -> bool:
        """Get whether the row before was not taken just now, so that the scan goes on here after a stop."""

    def run_up(self, row: int) -> Sequence[int]:
        """Get the rows to take again, and to drop, before a row at which the scan goes on."""

    def recall(self, row: int) -> JsonObject:
        """Go back to what was known before a row; returns what was recorded then, empty when nothing is."""

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:
        """Take one line with the laser on; ``between`` is called before each point and may raise."""


@runtime_checkable
class ZeroJob(ScanJob, Protocol):
    """A job that checks the range zero."""

    def take_zero(self, galvo: Galvo, sampler: Sampler, between: Between) -> ZeroReading | None:
        """Measure the mark of known range with the laser on, before the first line or after the last; None: no mark."""


class LineStore(Protocol):
    """Where lines become durable (`picoradar.instrument.recording.Recording`)."""

    @property
    def path(self) -> Path:
        """Get the file, to know the room on its disk."""

    def append(self, line: ScanLine, *, acknowledged_at_s: float | None = None) -> None:
        """Store a line; it is safe on disk when this returns."""

    def append_zero(self, reading: ZeroReading) -> None:
        """Store a reading of the mark of known range; it is safe on disk when this returns."""

    def event(self, time_s: float, kind: str, *, state: str | None = None, **fields: object) -> None:
        """Store what happened."""

    def finish(self, stop_reason: str, *, laser_off_verified: bool, **summary: object) -> bool:
        """Close the record of the scan."""


@dataclass
class ScanOutcome:
    """How a scan ended.

    Attributes
    ----------
    stop_reason : str
        ``complete``, ``finished early``, ``registered``, ``aborted``, ``interrupted``, or the cause of a fault.
    safe : SafeState
        What the safe shutdown found, step by step.
    lines, points : int
        Lines stored; entries in them that carry a range.
    device_time_s : float
        From the first point (laser on, diode at its working point) to the last, on the bench's clock; the
        shutdown to the safe state comes on top (`dark_s`).
    dark_s : float
        From the moment at which the end was decided to the last step of the safe shutdown.
    suspended : list of str
        Why the scan had to wait, each time.
    flags : Counter
        How many entries carry each flag, by its words.
    sinks : dict of str to str
        How far each sink came: ``complete``, lines skipped, failed, or hanging.
    """

    stop_reason: str = "complete"
    safe: SafeState = field(default_factory=SafeState)
    lines: int = 0
    points: int = 0
    device_time_s: float = 0.0
    dark_s: float = 0.0
    suspended: list[str] = field(default_factory=list)
    flags: Counter[str] = field(default_factory=Counter)
    sinks: dict[str, str] = field(default_factory=dict)

    def count(self, line: ScanLine) -> None:
        """Add a stored line to the counts."""
        self.lines += 1
        self.points += int(line.has_range.sum())
        for flag in Flag:
            if flag and (n := int(np.count_nonzero(line.flags & np.uint16(flag)))):
                self.flags[flag.words] += n
