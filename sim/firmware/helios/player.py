"""Plays the frames of the simulated Helios DAC: two buffers, and the mirrors' command.

Source: protocol sheet ``helios_dac.md``. A frame is played by one timer for each *change* of its points, not for each
point.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from picoradar.drivers.clock import Clock, Timer
from picoradar.drivers.helios import FrameFlag, GalvoFrame, wire
from picoradar.sim.wires import Mirrors

MARKER_LEVEL = 127


@dataclass(frozen=True)
class _Change:
    """Change at one point of a frame: a new position (None: the same), and whether the marker line rises."""

    after_s: float
    place: tuple[float, float] | None
    marker_rises: bool


class FramePlayer:
    """Output of the points.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    mirrors : Mirrors
        Gets each new position when its point is played, in -1..+1 of the analogue span.

    Attributes
    ----------
    on_marker : list of callables
        Called when the blue line rises above 127.
    """

    def __init__(self, clock: Clock, mirrors: Mirrors) -> None:
        self.on_marker: list[Callable[[], None]] = []
        self._clock = clock
        self._mirrors = mirrors
        self._playing: GalvoFrame | None = None
        self._waiting: GalvoFrame | None = None
        self._started = 0.0
        self._timer: Timer | None = None
        self._marker_high = False

    @property
    def full(self) -> bool:
        """Get whether both buffers are taken."""
        return self._waiting is not None

    def accept(self, frame: GalvoFrame) -> None:
        """Take a frame into a free buffer; the first plays at once, the next when the present one ends."""
        if self._playing is None or frame.flags & FrameFlag.START_AT_ONCE:
            self._waiting = None
            self._start(frame)
            return
        self._waiting = frame
        if self._timer is None:  # an unchanging frame that repeats sets no timers: it ends with its present round
            period_s = _duration_s(self._playing)
            rounds = int((self._clock.now() - self._started) / period_s) + 1
            self._timer = self._clock.call_at(self._started + rounds * period_s, self._frame_ended)

    def halt(self) -> None:
        """Go dark and drop both frames."""
        self._cancel()
        self._playing = self._waiting = None
        self._marker_high = False

    def centre_at(self, moment: float) -> None:
        """Send the mirrors to the centre at a moment (s), unless a frame comes before."""
        self._timer = self._clock.call_at(moment, lambda: self._mirrors.command(0.0, 0.0))

    def _start(self, frame: GalvoFrame) -> None:
        self._cancel()
        self._playing = frame
        self._started = self._clock.now()
        changes = self._changes(frame)
        if changes and changes[0].after_s == 0.0:
            self._apply(changes.popleft())
        if self._playing is frame:  # a marker's listener may have stopped it
            self._next(frame, changes)

    def _changes(self, frame: GalvoFrame) -> deque[_Change]:
        """Find the points at which the position changes or the marker line rises."""
        high = frame.colours[:, 2] > MARKER_LEVEL
        rises = high & ~np.concatenate([[self._marker_high], high[:-1]])
        moved = np.concatenate([[True], (np.diff(frame.xy.astype(int), axis=0) != 0).any(axis=1)])
        self._marker_high = bool(high[-1]) and not frame.flags & FrameFlag.PLAY_ONCE
        volts = (frame.xy.astype(float) - wire.CENTRE) / wire.CENTRE
        period_s = 1.0 / max(wire.RATE_MIN_HZ, frame.rate_hz)
        return deque(
            _Change(float(i) * period_s, (float(volts[i, 0]), float(volts[i, 1])) if moved[i] else None, bool(rises[i]))
            for i in np.flatnonzero(moved | rises)
        )

    def _next(self, frame: GalvoFrame, changes: deque[_Change]) -> None:
        """Set the one timer for the next change, or for the end of the frame."""
        if changes:
            change = changes.popleft()

            def play() -> None:
                self._apply(change)
                if self._playing is frame:
                    self._next(frame, changes)

            self._timer = self._clock.call_at(self._started + change.after_s, play)
            return
        still = bool((frame.xy == frame.xy[0]).all()) and not (frame.colours[:, 2] > MARKER_LEVEL).any()
        if still and not frame.flags & FrameFlag.PLAY_ONCE and self._waiting is None:
            self._timer = None
        else:
            self._timer = self._clock.call_at(self._started + _duration_s(frame), self._frame_ended)

    def _apply(self, change: _Change) -> None:
        if change.place is not None:
            self._mirrors.command(*change.place)
        if change.marker_rises:
            for listener in self.on_marker:
                listener()

    def _frame_ended(self) -> None:
        ended, self._playing, self._timer = self._playing, None, None
        following, self._waiting = self._waiting, None
        if following is not None:
            self._start(following)
        elif ended is not None and not ended.flags & FrameFlag.PLAY_ONCE:
            self._start(ended)

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def _duration_s(frame: GalvoFrame) -> float:
    return len(frame.xy) / max(wire.RATE_MIN_HZ, frame.rate_hz)
