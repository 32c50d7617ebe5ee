"""Queries to one MeCom device and its answers: matching, acknowledgement, retries, refusals.

Answers are matched by address and sequence number; all others (late answers to an earlier attempt) are dropped.
A retry uses the same number, so that a late answer to the first attempt still counts.
"""

from __future__ import annotations

from typing import NamedTuple

from picoradar.drivers.errors import DeviceFault, ProtocolError, Timeout, check_range
from picoradar.drivers.links import SerialLink
from picoradar.drivers.links.retry import retry
from picoradar.drivers.mecom.parameters import PARAMETERS, Kind, Parameter
from picoradar.drivers.mecom.wire import (
    END,
    REFUSALS,
    Frame,
    crc16,
    decode,
    decode_float,
    decode_int,
    encode,
    encode_float,
    encode_int,
)

TRIES = 3
LONGEST_ANSWER = 1024


class Metadata(NamedTuple):
    """What ``?VM`` reports about a parameter; bits of ``flags``: 0 readable, 1 writable."""

    kind: Kind
    flags: int
    instances: int
    elements: int
    minimum: float
    maximum: float
    value: float


class MeCom:
    """The host's end of the protocol.

    Parameters
    ----------
    link : SerialLink
        The line to the device.
    address : int
        The device's address, 1 to 254, or 0 for any one device.
    first_sequence : int
        Number of the first telegram, 0 to 65535. A different one at each start keeps late answers to
        an earlier program from being matched.
    """

    def __init__(self, link: SerialLink, address: int = 1, *, first_sequence: int = 0) -> None:
        check_range(link.device, "address", address, 0, 254)
        check_range(link.device, "first sequence number", first_sequence, 0, 0xFFFF)
        self.link = link
        self.address = address
        self._sequence = first_sequence

    def request(self, payload: str) -> str:
        """Send one telegram and get the payload of its answer (empty for an acknowledgement).

        Raises
        ------
        DeviceFault
            When the device refuses; ``code`` is the device's.
        Timeout
            When no answer came to three attempts.
        ProtocolError
            When only answers with a bad check sum or of the wrong form came.
        LinkLost
            When the port has vanished.
        """
        sequence, self._sequence = self._sequence, (self._sequence + 1) & 0xFFFF
        telegram = encode("#", self.address, sequence, payload)
        answer = retry(TRIES, lambda: self._exchange(telegram, payload, sequence))
        if (code := answer.refusal) is not None:
            meaning = REFUSALS.get(code, "device specific refusal")
            raise DeviceFault(self.link.device, f"refused {payload}: {code:02X}, {meaning}", code=code)
        return answer.payload

    def get(self, number: int, *, instance: int = 1) -> float:
        """Read one parameter (``?VR``); an integer comes as a whole float."""
        return self._value(PARAMETERS[number], self.request(f"?VR{number:04X}{instance:02X}"))

    def limits(self, number: int, *, instance: int = 1) -> tuple[float, float]:
        """Get the minimum and maximum value that the device accepts for a parameter (``?VL``)."""
        row = PARAMETERS[number]
        digits = self._of_length(f"?VL{number:04X}{instance:02X}", 16)
        return self._value(row, digits[:8]), self._value(row, digits[8:])

    def metadata(self, number: int, *, instance: int = 1) -> Metadata:
        """Get what the device reports about a parameter (``?VM``).

        Parameters
        ----------
        number : int
            Id of the parameter.
        instance : int
            Channel.

        Raises
        ------
        ProtocolError
            When the answer has not the expected form.
        """
        row = PARAMETERS[number]
        digits = self._of_length(f"?VM{number:04X}{instance:02X}", 38)
        try:
            kind, flags, instances = Kind(int(digits[0:2], 16)), int(digits[2:4], 16), int(digits[4:6], 16)
            elements = int(digits[6:14], 16)
        except ValueError as error:
            raise ProtocolError(self.link.device, f"{digits!r} is no metadata of {row.name}") from error
        values = [self._value(row, digits[i : i + 8]) for i in (14, 22, 30)]
        return Metadata(kind, flags, instances, elements, *values)

    def set(self, number: int, value: float, *, instance: int = 1) -> None:
        """Set one parameter (``VS``) within the range of the table.

        Raises
        ------
        LimitError
            When the value is out of range; nothing was sent.
        """
        row = PARAMETERS[number]
        check_range(self.link.device, row.name, value, row.minimum, row.maximum)
        digits = encode_float(value) if row.kind is Kind.FLOAT else encode_int(int(value))
        self.request(f"VS{number:04X}{instance:02X}{digits}")

    def _exchange(self, telegram: bytes, payload: str, sequence: int) -> Frame:
        """Send, and read until the answer with this number comes; a corrupted one is remembered for the message."""
        command_crc = crc16(telegram[:-5])
        wanted = ("!", self.address, sequence)
        is_query = payload.startswith("?")
        corrupted: bytes | None = None

        def match(line: bytes) -> Frame | None:
            nonlocal corrupted
            try:
                frame = decode(line)
            except ValueError:
                corrupted = line
                return None
            if frame[:3] != wanted:
                return None  # a late answer to an earlier telegram, or another device's
            if frame.is_intact and (is_query or frame.refusal is not None):
                return frame
            if not is_query and frame.acknowledges(command_crc):
                return frame
            corrupted = line
            return None

        self.link.write(telegram)
        try:
            return self.link.read_match(END, match, limit=LONGEST_ANSWER)
        except Timeout as error:
            if corrupted is None:
                raise
            what = f"corrupted answer {corrupted!r} to {payload}"
            raise ProtocolError(self.link.device, what, "check the baud rate") from error

    def _of_length(self, payload: str, length: int) -> str:
        answer = self.request(payload)
        if len(answer) != length:
            raise ProtocolError(self.link.device, f"answered {answer!r} to {payload}, not {length} digits")
        return answer

    def _value(self, row: Parameter, digits: str) -> float:
        try:
            return decode_float(digits) if row.kind is Kind.FLOAT else float(decode_int(digits))
        except ValueError as error:
            raise ProtocolError(self.link.device, f"{digits!r} is no value of {row.name}") from error
