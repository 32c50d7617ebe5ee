"""Splits a stream of bytes into lines, whatever chunks it comes in."""

from __future__ import annotations

import re


class LineReader:
    """Collects bytes until an end-of-line byte.

    Parameters
    ----------
    ends : bytes
        Every byte in it ends a line.
    limit : int
        Longest line. A longer one is returned truncated to ``limit + 1`` bytes, so that the device can
        recognise it.
    """

    def __init__(self, ends: bytes, limit: int) -> None:
        self._ends = re.compile(b"[" + re.escape(ends) + b"]")
        self.limit = limit
        self._line = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes and return the lines that they complete, without their ends."""
        lines = []
        *ended, rest = self._ends.split(data)
        for piece in ended:
            self._take(piece)
            lines.append(bytes(self._line))
            self._line.clear()
        self._take(rest)
        return lines

    def clear(self) -> None:
        """Discard the incomplete line."""
        self._line.clear()

    def _take(self, piece: bytes) -> None:
        self._line += piece[: self.limit + 1 - len(self._line)]
