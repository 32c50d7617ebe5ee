"""Refusals of point files."""

from __future__ import annotations

from pathlib import Path

from picoradar.instrument.errors import BadInput


class PointFileError(BadInput):
    """A point file cannot be used.

    Parameters
    ----------
    file : path
        The file.
    what : str
        What was found.
    remedy : str
        What to do about it.
    line : int, optional
        Line of a text file (from 1) or number of the point (from 1) in a binary one.
    """

    def __init__(self, file: Path, what: str, remedy: str, *, line: int | None = None) -> None:
        self.file = file
        self.line = line
        where = str(file) if line is None else f"{file}, line {line}"
        super().__init__(f"{where}: {what}; {remedy}")
