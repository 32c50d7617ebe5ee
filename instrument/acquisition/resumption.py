"""`Resumption`: what a scan that goes on in the middle needs, so that its lines come out as if it had never stopped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from picoradar.instrument.acquisition.order import LineOrder
from picoradar.instrument.events import JsonObject


class Resumption:
    """Knows the recorded states after the lines of a scan, and which lines to take again before one that is missing.

    At the first points of a line the mirrors still creep from the line before, by hundredths of a millimetre in mode
    window. A line is the same after a stop only if the mirrors have come to it in the same way; so the lines before it
    are taken again, with what was known then, and dropped.

    Parameters
    ----------
    states : mapping of int to dict
        The state recorded after each line (`Acquisition.state_dict`), by its number; -1 is the state before the first.
    order : LineOrder
    lines : int
        How many lines back a motion of the mirrors still shows.
    """

    def __init__(self, states: Mapping[int, JsonObject], order: LineOrder, lines: int) -> None:
        self._states = states
        self._order = order
        self._lines = lines

    def rows_before(self, row: int) -> Sequence[int]:
        """Return the lines to take again before ``row``; none where it is not known what was known before them."""
        before = self._order.before(row, self._lines)
        return before if all(self._order.last_before(again) in self._states for again in (*before, row)) else ()

    def state_before(self, row: int) -> JsonObject:
        """Return the state recorded after the line before ``row``; empty where there is none."""
        return self._states.get(self._order.last_before(row), {})
