"""The serial side of a simulated Meerstetter TEC-1091: frames, addresses, requests (protocol sheet ``mecom_tec``).

A frame with a bad check sum gets no answer. A set command is acknowledged with its own check sum.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from picoradar.drivers.clock import Clock
from picoradar.drivers.mecom import (
    ALL_ADDRESSES,
    ANY_ADDRESS,
    END,
    PARAMETERS,
    Frame,
    Kind,
    Parameter,
    decode,
    decode_float,
    decode_int,
    encode,
    encode_float,
    encode_int,
)
from picoradar.sim.firmware.lines import LineReader
from picoradar.sim.firmware.mecom.memory import Memory
from picoradar.sim.firmware.mecom.tec_device import OutOfRange, TecDevice
from picoradar.sim.wires import HeatPump

ANSWER_S = 0.001
BAUD_SILENCE_S = 5.0
LONGEST_FRAME = 256
NOT_A_COMMAND, FORMAT, UNKNOWN, READ_ONLY, RANGE, INSTANCE = 0x01, 0x04, 0x05, 0x06, 0x07, 0x08
IDENTITY = "8065-TEC SW G01     "
READABLE, WRITABLE = 1, 2
LOOKUP_IDLE = "0"


class Refused(Exception):
    """A request is refused with a code of the sheet."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class TecFirmware:
    """A temperature controller on a serial line.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    heat_pump : HeatPump
        What it drives and measures.
    address : int
        Address on the line.
    device_type, serial_number, firmware : int
        Parameters 100, 102 and 103.
    """

    def __init__(
        self,
        clock: Clock,
        heat_pump: HeatPump,
        address: int = 1,
        *,
        device_type: int = 1091,
        serial_number: int = 112,
        firmware: int = 610,
    ) -> None:
        self.clock = clock
        self.memory = Memory(clock, {2051: address, 100: device_type, 101: 140, 102: serial_number, 103: firmware})
        self.device = TecDevice(clock, heat_pump, self.memory, self._restarted)
        self.baud = int(self.memory.values[2050])
        self._lines = LineReader(END, limit=LONGEST_FRAME)
        self._send: Callable[[bytes, float], None] | None = None
        self._requests = self._request_table()

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send

    def receive(self, data: bytes) -> None:
        """Take bytes that have arrived from the host."""
        for line in self._lines.feed(data):
            self._take(line)

    def _take(self, line: bytes) -> None:
        try:
            frame = decode(line)
        except ValueError:
            return  # no answer to what is not a frame
        mine = (int(self.memory.values[2051]), ANY_ADDRESS, ALL_ADDRESSES)
        if frame.control != "#" or not frame.is_intact or frame.address not in mine or not self.device.answers:
            return
        self.device.heard()
        try:
            payload = self._answer(frame.payload)
        except Refused as refusal:
            payload = f"+{refusal.code:02X}"
        if frame.address != ALL_ADDRESSES:
            self._reply(frame, payload)

    def _reply(self, frame: Frame, payload: str) -> None:
        if self._send is not None:
            crc = None if payload else frame.crc  # an acknowledgement carries the command's check sum
            delay_s = ANSWER_S + self.memory.values[2052] * 1e-6
            self._send(encode("!", frame.address, frame.sequence, payload, crc=crc), delay_s)

    def _request_table(self) -> dict[str, Callable[[str], str | None]]:
        """Build the table of requests; each takes what follows its name, and gives its answer if it has one."""
        return {
            "?VR": lambda rest: self._text(*_row(rest)),
            "?VM": lambda rest: self._metadata(*_row(rest)),
            "?VL": lambda rest: _limits(_row(rest)[0]),
            "?VX": self._several,
            "?IF": lambda _: IDENTITY,  # the manufacturer's client adds a channel
            "?LT": _look_up_table,
            "VS": lambda rest: self._set(*_row(rest[:6]), rest[6:]),
            "RS": _without_argument(self.device.reset),
            "SP": _without_argument(self.memory.save),
            "ES": _without_argument(self.device.stop),
            "CS": lambda rest: self._change_baud(decode_int(rest)),
        }

    def _answer(self, payload: str) -> str:
        """Carry out one request and return the payload of its answer; empty for an acknowledgement."""
        length = 3 if payload.startswith("?") else 2
        request = self._requests.get(payload[:length])
        if request is None:
            raise Refused(NOT_A_COMMAND)
        try:
            return request(payload[length:]) or ""
        except OutOfRange:
            raise Refused(RANGE) from None
        except ValueError:
            raise Refused(FORMAT) from None

    def _text(self, row: Parameter, instance: int) -> str:
        return _encode(row, self.device.value(row.number, instance))

    def _metadata(self, row: Parameter, instance: int) -> str:
        flags = READABLE | WRITABLE if row.writable else READABLE
        return f"{row.kind.value:02X}{flags:02X}{row.instances:02X}00000001{_limits(row)}{self._text(row, instance)}"

    def _several(self, digits: str) -> str:
        count, rest = _hex(digits[:2]), digits[2:]
        if len(rest) != 6 * count:
            raise Refused(FORMAT)
        return "".join(self._text(*_row(rest[i : i + 6])) for i in range(0, len(rest), 6))

    def _set(self, row: Parameter, instance: int, digits: str) -> None:
        if not row.writable:
            raise Refused(READ_ONLY)
        value = decode_float(digits) if row.kind is Kind.FLOAT else decode_int(digits)
        if not (math.isfinite(value) and row.minimum <= value <= row.maximum):
            raise Refused(RANGE)
        self.device.set(row.number, value, instance)

    def _change_baud(self, baud: int) -> None:
        """Run at another rate once the answer is out, and fall back after 5 s of silence."""
        limits = PARAMETERS[2050]
        if not limits.minimum <= baud <= limits.maximum:
            raise Refused(RANGE)
        before, now = self.baud, self.clock.now()

        def fall_back() -> None:
            if self.clock.now() - self.device.last_heard_s < BAUD_SILENCE_S:
                self.clock.call_at(self.device.last_heard_s + BAUD_SILENCE_S, fall_back)
            else:
                self._run_at(before)

        self.clock.call_at(now + 2 * ANSWER_S, lambda: self._run_at(baud))
        self.clock.call_at(now + BAUD_SILENCE_S, fall_back)

    def _run_at(self, baud: int) -> None:
        self.baud = baud

    def _restarted(self) -> None:
        self.baud = int(self.memory.values[2050])
        self._lines.clear()


def _without_argument(run: Callable[[], str | None]) -> Callable[[str], str | None]:
    """Make a request that takes no argument."""

    def request(rest: str) -> str | None:
        if rest:
            raise Refused(FORMAT)
        return run()

    return request


def _look_up_table(rest: str) -> str:
    """Answer ``?LT0``, the state of the look-up table; this device stores none."""
    if rest[:1] in ("1", "2"):
        raise Refused(NOT_A_COMMAND)
    if rest != "0":
        raise Refused(FORMAT)
    return LOOKUP_IDLE


def _row(digits: str) -> tuple[Parameter, int]:
    """Find the parameter that four hex digits name, and its instance in two more."""
    if len(digits) != 6:
        raise Refused(FORMAT)
    number, instance = _hex(digits[:4]), _hex(digits[4:])
    if number not in PARAMETERS:
        raise Refused(UNKNOWN)
    if not 1 <= instance <= PARAMETERS[number].instances:
        raise Refused(INSTANCE)
    return PARAMETERS[number], instance


def _limits(row: Parameter) -> str:
    return _encode(row, row.minimum) + _encode(row, row.maximum)


def _encode(row: Parameter, value: float) -> str:
    return encode_float(value) if row.kind is Kind.FLOAT else encode_int(int(value))


def _hex(digits: str) -> int:
    if not digits or digits.strip("0123456789ABCDEF"):
        raise Refused(FORMAT)
    return int(digits, 16)
