"""`LineOrder`: in which order the lines of a raster are taken, and which line beside one is there before it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

Order = Literal["rows", "interlaced"]

COARSEST = 16
"""Step of the first pass of an interlaced raster, lines: of 40 lines it takes three, across the whole target."""


class LineOrder:
    """The lines of a raster in the order in which they are taken.

    ``rows`` is from top to bottom. ``interlaced`` takes every 16th line first, then those halfway between, and so on:
    what is known early is coarse, but of the whole target, which a pose needs more than a fine part of it.

    Parameters
    ----------
    rows : int
        Lines of the raster.
    name : {"rows", "interlaced"}

    Examples
    --------
    >>> LineOrder(20, "interlaced").lines[:6]
    (0, 16, 8, 4, 12, 2)
    """

    def __init__(self, rows: int, name: Order = "rows") -> None:
        self.name = name
        self.lines: tuple[int, ...] = tuple(range(rows))
        if name == "interlaced":
            steps = [COARSEST >> k for k in range(COARSEST.bit_length())]
            self.lines = tuple(dict.fromkeys(line for step in steps for line in range(0, rows, step)))
        self._places = {line: place for place, line in enumerate(self.lines)}

    def place(self, line: int) -> int:
        """Return when a line is taken, from 0; -1 of no line (-1), the start."""
        return self._places.get(line, -1)

    def sorted(self, lines: Iterable[int]) -> list[int]:
        """Return some lines in this order."""
        return sorted(lines, key=self.place)

    def before(self, line: int, count: int = 1) -> Sequence[int]:
        """Return so many lines that are taken just before a line, in order; fewer at the beginning."""
        place = self.place(line)
        return self.lines[max(0, place - count) : place]

    def last_before(self, line: int) -> int:
        """Return the line that is taken just before a line; -1 before the first."""
        return next(iter(self.before(line)), -1)

    def next_after(self, line: int) -> int | None:
        """Return the line that is taken just after a line (-1: the first one); None after the last."""
        place = self.place(line) + 1
        return self.lines[place] if place < len(self.lines) else None

    def beside(self, line: int) -> Sequence[int]:
        """Return the neighbours of a line in the raster that are taken before it, the one above first."""
        return [near for near in (line - 1, line + 1) if 0 <= self.place(near) < self.place(line)]
