"""Identifies the device on a serial port when the expected one does not answer.

Queries the identity in the protocol of each known device and searches the answer for the mark of that device. Only
queries are sent, nothing is set.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from picoradar.drivers.clock import Clock
from picoradar.drivers.dg645 import wire as dg645_wire
from picoradar.drivers.errors import DeviceError
from picoradar.drivers.genesys import wire as genesys_wire
from picoradar.drivers.links import SerialLink
from picoradar.drivers.mecom import wire as mecom_wire
from picoradar.drivers.tc200 import wire as tc200_wire

QUIET_S = 0.3


@dataclass(frozen=True)
class Kind:
    """A kind of device that may sit on a serial port.

    Attributes
    ----------
    name : str
        As in the settings.
    question : bytes
        Queries the identity; its first byte ends a half-sent message on the line.
    mark : re.Pattern
        Part of the answer that only this kind sends.
    bauds : tuple of int
        Rates it can be set to, as shipped first.
    """

    name: str
    question: bytes
    mark: re.Pattern[bytes]
    bauds: tuple[int, ...]


@dataclass(frozen=True)
class Answer:
    """The device that answers: its kind, and its baud rate (None: the link has none)."""

    kind: str
    baud: int | None


def kinds(genesys_address: int) -> tuple[Kind, ...]:
    """Get the kinds of this bench."""
    return (
        Kind(
            "dg645",
            dg645_wire.encode("") + dg645_wire.encode("*IDN?"),
            re.compile(rb",DG645,"),
            (9600, 4800, 19200, 38400, 57600, 115200),
        ),
        Kind(
            "genesys",
            b"\r" + genesys_wire.encode(f"ADR {genesys_address}") + genesys_wire.encode("IDN?"),
            re.compile(rb"LAMBDA|TDK"),
            (9600, 19200, 4800, 2400, 1200),
        ),
        Kind(
            "tec",
            b"\r" + mecom_wire.encode("#", 0, 0, "?VR006401"),
            re.compile(rb"![0-9A-F]{6}000004(41|43)"),  # device type 1089 or 1091
            (57600, 9600, 115200, 38400, 19200, 4800),
        ),
        Kind(
            "tc200",
            tc200_wire.encode("") + tc200_wire.encode("*idn?"),
            re.compile(rb"TC200"),
            (115200,),
        ),
    )


def identify_port(url: str, clock: Clock, *, expected: str, baud: int, genesys_address: int) -> Answer | None:
    """Query the port as each kind of device until one answers; None when none does, or the port cannot be opened.

    Parameters
    ----------
    url : str
        Port or URL.
    clock : Clock
    expected : str
        Kind that should be there; it is tried first, at all its rates.
    baud : int
        Rate in the settings, which has been tried.
    genesys_address : int
    """
    for kind, rate in _candidates(url, expected, genesys_address):
        link = SerialLink(url, clock, device=kind.name, baud=rate or baud)
        try:
            link.open()
            link.write(kind.question)
            came = link.drain(quiet_s=QUIET_S)
        except DeviceError:
            return None
        finally:
            link.close()
        if kind.mark.search(came):
            return Answer(kind.name, rate)
    return None


def _candidates(url: str, expected: str, genesys_address: int) -> Iterator[tuple[Kind, int | None]]:
    known = sorted(kinds(genesys_address), key=lambda kind: kind.name != expected)
    for kind in known:
        if "://" in url:  # such a link has no baud rate
            yield kind, None
        else:
            yield from ((kind, rate) for rate in (kind.bauds if kind.name == expected else kind.bauds[:1]))
