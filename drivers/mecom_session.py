"""Questions and answers with one MeCom device: matching, acknowledgement, retries, refusals.

Answers are matched by address and sequence number; all others (late answers of an earlier try) are dropped.
A retry uses the same number, so that a late answer to the first try still counts.
"""

from __future__ import annotations

from drivers.errors import DeviceFault, ProtocolError, Timeout, check_range
from drivers.mecom_parameters import PARAMETERS, Kind, Parameter
from drivers.mecom_wire import (
    ALL_ADDRESSES,
    END,
    REFUSALS,
    crc16,
    decode,
    decode_float,
    decode_int,
    encode,
    encode_float,
    encode_int,
)
from drivers.serial_link import SerialLink

TRIES = 3


class MeCom:
    """The host's end of the protocol.

    Parameters
    ----------
    link : SerialLink
        The line to the device.
    address : int
        The device's address, 1 to 254, or 0 for any one device.
    first_sequence : int
        Number of the first telegram, 0 to 65535. Different from start to start, it keeps a late answer to
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
            When no answer came to three tries.
        ProtocolError
            When only answers with a bad check sum or of a wrong form came.
        LinkLost
            When the port has vanished.
        """
        telegram = self._next(self.address, payload)
        for left in reversed(range(TRIES)):
            self.link.write(telegram)
            try:
                answer = self._answer_to(telegram, payload)
                break
            except (Timeout, ProtocolError):
                if not left:
                    raise
        if answer.startswith("+"):
            code = int(answer[1:], 16)
            meaning = REFUSALS.get(code, "device specific refusal")
            raise DeviceFault(self.link.device, f"refused {payload}: {code:02X}, {meaning}", code=code)
        return answer

    def broadcast(self, payload: str) -> None:
        """Send one telegram to all devices on the line; none answers."""
        self.link.write(self._next(ALL_ADDRESSES, payload))

    def get(self, number: int, *, instance: int = 1) -> float:
        """Read one parameter (``?VR``); an integer comes as a whole float."""
        row = PARAMETERS[number]
        return self._value(row, self.request(f"?VR{number:04X}{instance:02X}"))

    def set(self, number: int, value: float, *, instance: int = 1) -> None:
        """Set one parameter (``VS``) of which the range is the table's.

        Raises
        ------
        LimitError
            When the value is out of range; nothing was sent.
        """
        row = PARAMETERS[number]
        check_range(self.link.device, row.name, value, row.least, row.most)
        digits = encode_float(value) if row.kind is Kind.FLOAT else encode_int(int(value))
        self.request(f"VS{number:04X}{instance:02X}{digits}")

    def _next(self, address: int, payload: str) -> bytes:
        telegram = encode("#", address, self._sequence, payload)
        self._sequence = (self._sequence + 1) & 0xFFFF
        return telegram

    def _answer_to(self, telegram: bytes, payload: str) -> str:
        """Read until the answer to ``telegram`` comes; a spoilt one is remembered for the message."""
        clock = self.link.clock
        sent = decode(telegram)
        command_crc = crc16(telegram[:-5])
        end = clock.now() + self.link.timeout_s
        spoilt: bytes | None = None
        while (left_s := end - clock.now()) > 0:
            try:
                line = self.link.read_until(END, timeout_s=left_s, limit=256)
            except Timeout:
                break
            try:
                frame = decode(line)
            except ValueError:
                spoilt = line
                continue
            if (frame.control, frame.address, frame.sequence) != ("!", sent.address, sent.sequence):
                continue
            is_query = payload.startswith("?")
            if (frame.is_intact and (is_query or frame.refusal is not None)) or (
                not is_query and frame.acknowledges(command_crc)
            ):
                return frame.payload
            spoilt = line
        if spoilt is not None:
            raise ProtocolError(self.link.device, f"spoilt answer {spoilt!r} to {payload}", "check the baud rate")
        what = f"no answer to {payload} within {self.link.timeout_s:g} s"
        raise Timeout(self.link.device, what, "check power, cable, baud rate and address")

    def _value(self, row: Parameter, digits: str) -> float:
        try:
            return decode_float(digits) if row.kind is Kind.FLOAT else float(decode_int(digits))
        except ValueError as error:
            raise ProtocolError(self.link.device, f"{digits!r} is no value of {row.name}") from error
