"""The firmware of a simulated Meerstetter TEC-1091 (protocol sheet ``mecom_tec``): frames, parameters, watchdog.

A frame with a bad check sum gets no answer. A set command is acknowledged with its own check sum.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from drivers.clock import Clock, Timer
from drivers.mecom_parameters import PARAMETERS, DeviceStatus, Kind, OutputEnable, Parameter
from drivers.mecom_wire import (
    ALL_ADDRESSES,
    ANY_ADDRESS,
    END,
    Frame,
    decode,
    decode_float,
    decode_int,
    encode,
    encode_float,
    encode_int,
)
from sim.firmware.lines import LineReader
from sim.firmware.mecom_memory import Memory
from sim.firmware.tec_loop import PELTIER_OHM, TemperatureLoop
from sim.wires import HeatPump

ANSWER_S = 0.001
RESET_S = 0.2
SHORTEST_WATCHDOG_S = 0.1
START_UP_S = 1.0
BAUD_SILENCE_S = 5.0
LONGEST_FRAME = 256
EMERGENCY_STOP, WATCHDOG_EXPIRED = 11, 183
NOT_A_COMMAND, FORMAT, UNKNOWN, READ_ONLY, RANGE, INSTANCE = 0x01, 0x04, 0x05, 0x06, 0x07, 0x08
IDENTITY = "8065-TEC SW G01     "


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
        self.heat_pump = heat_pump
        self.memory = Memory(clock, address)
        self.loop = TemperatureLoop(clock, heat_pump, self.memory.values, self.trip)
        self.baud = int(self.memory.values[2050])
        self._constants = {100: device_type, 101: 140, 102: serial_number, 103: firmware}
        self._status = DeviceStatus.READY
        self._error = (0, 0)
        self._last_heard_s = clock.now()
        self._watchdog: Timer | None = None
        self._lines = LineReader(END, limit=LONGEST_FRAME)
        self._send: Callable[[bytes, float], None] | None = None

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send

    def receive(self, data: bytes) -> None:
        """Take bytes that have arrived from the host."""
        for line in self._lines.feed(data):
            self._take(line)

    def trip(self, error: int, parameter: int = 0) -> None:
        """Latch an error and switch the output off; only a reset leaves it."""
        if not self._error[0]:
            self._error = (error, parameter)
        self._status = DeviceStatus.ERROR
        self.memory.values[2010] = OutputEnable.OFF
        self.loop.stop()

    def _take(self, line: bytes) -> None:
        if self._status is DeviceStatus.INIT:
            return
        try:
            frame = decode(line)
        except ValueError:
            return
        address = int(self.memory.values[2051])
        if frame.control != "#" or not frame.is_intact or frame.address not in (address, ANY_ADDRESS, ALL_ADDRESSES):
            return
        self._last_heard_s = self.clock.now()
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

    def _answer(self, payload: str) -> str:
        """Carry out one request and return the payload of its answer; empty for an acknowledgement."""
        verb, rest = (payload[:3], payload[3:]) if payload.startswith("?") else (payload[:2], payload[2:])
        if verb not in ("?VR", "?VM", "?VL", "?VX", "?IF", "VS", "RS", "SP", "ES", "CS"):
            raise Refused(NOT_A_COMMAND)
        try:
            if verb == "?VR":
                return self._text(self._row(rest))
            if verb == "?VM":
                return self._metadata(self._row(rest))
            if verb == "?VL":
                return self._limits(self._row(rest))
            if verb == "?VX":
                return self._several(rest)
            if verb == "VS":
                return self._set(self._row(rest[:6]), rest[6:])
            if verb == "CS":
                return self._change_baud(decode_int(rest))
        except ValueError:
            raise Refused(FORMAT) from None
        if rest:
            raise Refused(FORMAT)
        return self._plain(verb)

    def _plain(self, verb: str) -> str:
        """Carry out a request without parameters."""
        if verb == "?IF":
            return IDENTITY
        if verb == "SP":
            self.memory.save()
        elif verb == "ES":
            self.trip(EMERGENCY_STOP)
        elif verb == "RS":
            self.loop.stop()
            self._status = DeviceStatus.ABOUT_TO_RESET
            self.clock.call_at(self.clock.now() + RESET_S, self._restart)
        return ""

    def _row(self, digits: str) -> Parameter:
        """Find the parameter that four hex digits name, with two of its instance."""
        if len(digits) != 6:
            raise Refused(FORMAT)
        number, instance = _hex(digits[:4]), _hex(digits[4:])
        if number not in PARAMETERS:
            raise Refused(UNKNOWN)
        if instance != 1:
            raise Refused(INSTANCE)
        return PARAMETERS[number]

    def _value(self, number: int) -> float:
        loop = self.loop
        measured: dict[int, Callable[[], float]] = {
            104: lambda: (
                self._status if self._status is not DeviceStatus.READY or not loop.running else DeviceStatus.RUN
            ),
            105: lambda: self._error[0],
            106: lambda: 1 if self._error[0] else 0,
            107: lambda: self._error[1],
            1000: self.heat_pump.temperature_degc,
            1001: self.heat_pump.sink_degc,
            1010: lambda: self.memory.values[3000],
            1011: lambda: loop.nominal_degc if loop.running else self.heat_pump.temperature_degc(),
            1020: lambda: loop.current_a,
            1021: lambda: loop.current_a * PELTIER_OHM,
            1200: lambda: loop.stability,
        }
        if number in self._constants:
            return self._constants[number]
        return measured[number]() if number in measured else self.memory.values[number]

    def _text(self, row: Parameter) -> str:
        return _encode(row, self._value(row.number))

    def _metadata(self, row: Parameter) -> str:
        return f"{row.kind.value:02X}{3 if row.writable else 1:02X}0100000001{self._limits(row)}{self._text(row)}"

    def _limits(self, row: Parameter) -> str:
        return _encode(row, row.least) + _encode(row, row.most)

    def _several(self, digits: str) -> str:
        count, rest = _hex(digits[:2]), digits[2:]
        if len(rest) != 6 * count:
            raise Refused(FORMAT)
        return "".join(self._text(self._row(rest[i : i + 6])) for i in range(0, len(rest), 6))

    def _set(self, row: Parameter, digits: str) -> str:
        if not row.writable:
            raise Refused(READ_ONLY)
        value = decode_float(digits) if row.kind is Kind.FLOAT else decode_int(digits)
        if not (math.isfinite(value) and row.least <= value <= row.most):
            raise Refused(RANGE)
        if row.number == 2060 and 0 < value < SHORTEST_WATCHDOG_S:
            raise Refused(RANGE)
        self.memory.set(row.number, value)
        if row.number in (2010, 50000):
            self._switch()
        elif row.number == 2060:
            self._arm()
        return ""

    def _switch(self) -> None:
        """Bring the output to what parameter 2010 says; the hardware pin of this bench is off."""
        wanted = OutputEnable(int(self.memory.values[2010]))
        on = wanted is OutputEnable.ON or (wanted is OutputEnable.LIVE and bool(self.memory.values[50000]))
        if on and self._status is DeviceStatus.READY:
            self.loop.start()
        else:
            self.loop.stop()

    def _arm(self) -> None:
        """Set the watchdog's timer to the moment at which silence will have lasted too long."""
        if self._watchdog is not None:
            self._watchdog.cancel()
            self._watchdog = None
        if limit_s := self.memory.values[2060]:
            self._watchdog = self.clock.call_at(self._last_heard_s + limit_s, self._check_silence)

    def _check_silence(self) -> None:
        # One timer in flight, moved on when it falls due: cheaper than a new one for every telegram.
        if self.clock.now() - self._last_heard_s < self.memory.values[2060] - 1e-9:
            self._arm()
            return
        self._watchdog = None
        self.trip(WATCHDOG_EXPIRED, 2060)

    def _change_baud(self, baud: int) -> str:
        if not 4800 <= baud <= 1_000_000:
            raise Refused(RANGE)
        before = self.baud
        self.clock.call_at(self.clock.now() + 2 * ANSWER_S, lambda: self._run_at(baud))

        def fall_back() -> None:
            if self.clock.now() - self._last_heard_s < BAUD_SILENCE_S:
                self.clock.call_at(self._last_heard_s + BAUD_SILENCE_S, fall_back)
            else:
                self._run_at(before)

        self.clock.call_at(self.clock.now() + BAUD_SILENCE_S, fall_back)
        return ""

    def _run_at(self, baud: int) -> None:
        self.baud = baud

    def _restart(self) -> None:
        self._status = DeviceStatus.INIT
        self._error = (0, 0)
        self.memory.reload()
        self.baud = int(self.memory.values[2050])
        self._lines.clear()
        self._arm()
        self.clock.call_at(self.clock.now() + START_UP_S, self._ready)

    def _ready(self) -> None:
        self._status = DeviceStatus.READY


def _encode(row: Parameter, value: float) -> str:
    return encode_float(value) if row.kind is Kind.FLOAT else encode_int(int(value))


def _hex(digits: str) -> int:
    if not digits or digits.strip("0123456789ABCDEF"):
        raise Refused(FORMAT)
    return int(digits, 16)
