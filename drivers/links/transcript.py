"""Transcripts: every byte that crosses the links of a bench, written when asked for and read to replay a bug report.

A transcript is a text file of JSON objects, one a line. The first one is ``{"transcript": "picoradar", "version": 1}``,
each other one is an event of a link:

``time_s``
    Device time (seconds of the bench's clock).
``link``
    Name of the device, as in its messages.
``what``
    ``open``, ``close`` and ``lost`` for the link itself; ``write`` and ``read`` for bytes to and from the device;
    ``control_out``, ``control_in`` and ``clear_halt`` for USB.
``data``
    The bytes, in hex.
``error``
    Where the device refused (``stall``).
``ahead``
    True for an answer that was not waited for: it came some time before it was looked for, which is ``time_s``.

An ``open`` says how the link was opened (``url`` and ``baud``, or the USB descriptors); USB transfers have
``endpoint``, control transfers ``request`` and ``value``. A read that returned nothing is left out.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self, TypedDict, cast

from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import DECODER_ERRORS, decoder_words, parse_json, read_text

HEAD = {"transcript": "picoradar", "version": 1}

LARGEST_TRANSCRIPT_BYTES = 1_000_000_000
"""Longest transcript that is read, bytes; a scan of 40 x 40 points in sweeps writes about 100 MB."""


InterfaceDetails = TypedDict(
    "InterfaceDetails", {"number": int, "alternate": int, "class": list[int], "endpoints": list[list[int]]}
)
"""One alternate setting of a USB device; each endpoint as address, attributes, packet size and interval."""


class EventDetails(TypedDict, total=False):
    """Details of an event beside its bytes; the keys depend on its kind."""

    url: str
    baud: int
    endpoint: int
    kind: int
    request: int
    value: int
    index: int
    error: str
    ahead: bool
    idVendor: int
    idProduct: int
    bcdDevice: int
    speed: int
    strings: list[str | None]
    interfaces: list[InterfaceDetails]


@dataclass(frozen=True)
class Event:
    """One line of a transcript.

    Attributes
    ----------
    time_s : float
    link, what : str
    data : bytes
    more : EventDetails
        All other keys.
    """

    time_s: float
    link: str
    what: str
    data: bytes = b""
    more: EventDetails = field(default_factory=EventDetails)


class Transcript:
    """A transcript that is being written; each line is in the file at once.

    Parameters
    ----------
    path : Path
        File to make.

    Attributes
    ----------
    failure : str
        Why it ends early (a full disk); empty when it does not. What crosses the links is not held up by it.

    Raises
    ------
    OSError
        When it exists already or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.failure = ""
        self._file = path.open("x", encoding="utf-8", buffering=1)
        self._file.write(json.dumps(HEAD) + "\n")

    def note(self, time_s: float, link: str, what: str, data: bytes | None = None, **more: object) -> None:
        """Write one event; after a failure nothing more, for what comes later would not follow on what is there."""
        if self.failure:
            return
        event: dict[str, object] = {"time_s": round(time_s, 6), "link": link, "what": what, **more}
        if data is not None:
            event["data"] = bytes(data).hex()
        try:
            self._file.write(json.dumps(event) + "\n")
        except OSError as error:
            self.failure = str(error)

    def close(self) -> None:
        """Close the file; links write nothing more into it."""
        try:
            self._file.close()
        except OSError as error:  # what is left of it finds no room either
            self.failure = self.failure or str(error)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()


class TranscribedLink:
    """Base of the links: writes what crosses the link into a transcript, where one is wanted.

    Parameters
    ----------
    clock : Clock
        Time of the link.
    name : str
        The device's name.

    Attributes
    ----------
    transcript : Transcript or None
        Records every byte in both directions; None (the default) records nothing.
    """

    transcript: Transcript | None = None

    def __init__(self, clock: Clock, name: str) -> None:
        self.clock = clock
        self.name = name

    def _note(self, what: str, data: bytes | None = None, /, **more: object) -> None:
        if self.transcript is not None:
            self.transcript.note(self.clock.now(), self.name, what, data, **more)


def read_transcript(path: Path) -> list[Event]:
    """Read a transcript.

    Raises
    ------
    ValueError
        When it is none, or a line of it is damaged: with file, line and what is wrong. A last line without its end
        (the program was killed) is left out.
    """
    try:
        lines = read_text(path, LARGEST_TRANSCRIPT_BYTES).splitlines(keepends=True)
    except ValueError as error:
        raise ValueError(f"{path}: no transcript of picoradar: {error}") from error
    if not lines or _parsed(path, 1, lines[0]) != HEAD:
        raise ValueError(f"{path}: no transcript of picoradar (version 1)")
    return list(_events(path, lines[1:]))


def _events(path: Path, lines: list[str]) -> Iterator[Event]:
    for number, line in enumerate(lines, 2):
        if not line.endswith("\n"):
            return
        table = _parsed(path, number, line)
        try:
            time_s, link, what = float(str(table.pop("time_s"))), str(table.pop("link")), str(table.pop("what"))
            yield Event(time_s, link, what, bytes.fromhex(str(table.pop("data", ""))), cast(EventDetails, table))
        except DECODER_ERRORS as error:
            raise ValueError(f"{path}, line {number}: no event of a transcript: {decoder_words(error)}") from error


def _parsed(path: Path, number: int, line: str) -> dict[str, object]:
    try:
        table = parse_json(line)
    except ValueError as error:
        raise ValueError(f"{path}, line {number}: not JSON: {error}") from error
    if not isinstance(table, dict):
        raise ValueError(f"{path}, line {number}: not a JSON object")
    return table
