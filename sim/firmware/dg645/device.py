"""The firmware of a simulated SRS DG645 (protocol sheet ``dg645``): commands, registers, triggers.

Triggers are counted, not generated one by one: the status bits follow from the rate and the time that has passed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from functools import partial

from picoradar.drivers.clock import Clock
from picoradar.sim.firmware.dg645.registers import OPC, Refused, Registers
from picoradar.sim.firmware.dg645.settings import SETTINGS, Settings, channel, integer, number
from picoradar.sim.firmware.dg645.triggers import TriggerEngine
from picoradar.sim.firmware.lines import LineReader
from picoradar.sim.wires import InterlockChain, TriggerLine

ANSWER_S = 0.003
ABORTED = 0x20
ILLEGAL_VALUE, RECALL_FAILED = 10, 14
ILLEGAL, UNDEFINED, ILLEGAL_QUERY, ILLEGAL_SET, TOO_MANY, TOO_FEW, OVERRUN = 110, 111, 112, 113, 115, 116, 171
_COMMAND = re.compile(r"(\*?[A-Z]+)\s*(\??)\s*(.*)", re.DOTALL)


@dataclass(frozen=True)
class _Set:
    parameters: tuple[int, int]
    run: Callable[[list[str]], None]


@dataclass(frozen=True)
class _Query:
    parameters: tuple[int, int]
    run: Callable[[list[str]], str]


class Dg645Firmware:
    """A delay generator on a serial line; its output AB drives the laser trigger.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    trigger : TriggerLine
        Wire that it drives: ``rate_hz`` is the rate of pulses on AB, 0 when there are none.
    interlock : InterlockChain
        Connected to the INHIBIT input.
    serial_number : str
        As in ``*IDN?``.
    """

    baud = 9600

    def __init__(
        self, clock: Clock, trigger: TriggerLine, interlock: InterlockChain, *, serial_number: str = "001013"
    ) -> None:
        self.clock = clock
        self.settings = Settings()
        self.registers = Registers()
        self.identity = f"Stanford Research Systems,DG645,s/n{serial_number},ver1.02.0A"
        self._memories: dict[int, Settings] = {}
        self._display = "0,0"
        self._reply_end = b"\r\n"
        self._triggers = TriggerEngine(clock, trigger, interlock, self.registers)
        self._lines = LineReader(b"\r\n", limit=256)
        self._send: Callable[[bytes, float], None] | None = None
        self._sets, self._queries = self._tables()
        interlock.on_change(lambda: self._triggers.apply(self.settings))
        self._triggers.apply(self.settings)

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send

    def receive(self, data: bytes) -> None:
        """Take bytes that have arrived from the host."""
        for line in self._lines.feed(data):
            if len(line) > self._lines.limit:
                self.registers.put_error(OVERRUN)
                continue
            for text in line.decode("latin-1").split(";"):
                if command := text.strip():
                    self._execute(command.upper())

    def _execute(self, command: str) -> None:
        try:
            reply = self._carry_out(command)
        except Refused as refusal:
            self.registers.put_error(refusal.code)
            return
        if reply is not None and self._send is not None:
            self._send(reply.encode("ascii") + self._reply_end, ANSWER_S)

    def _carry_out(self, command: str) -> str | None:
        match = _COMMAND.fullmatch(command)
        if match is None:
            raise Refused(ILLEGAL)
        name, question, rest = match.groups()
        parameters = [part.strip() for part in rest.split(",")] if rest else []
        if name not in self._sets and name not in self._queries:
            raise Refused(UNDEFINED)
        if question:
            if (query := self._queries.get(name)) is None:
                raise Refused(ILLEGAL_QUERY)
            _check_count(parameters, query.parameters)
            return query.run(parameters)
        if (action := self._sets.get(name)) is None:
            raise Refused(ILLEGAL_SET)
        _check_count(parameters, action.parameters)
        action.run(parameters)
        self._triggers.apply(self.settings)
        return None

    def _tables(self) -> tuple[dict[str, _Set], dict[str, _Query]]:
        """Build the command table: the number of parameters of each command, and what it does."""
        sets: dict[str, _Set] = {}
        queries: dict[str, _Query] = {}
        for name, row in SETTINGS.items():
            index = 0 if row.places is None else 1
            sets[name] = _Set((index + 1, index + 1), partial(self._set_row, name))
            queries[name] = _Query((index, index), partial(self._row_text, name))
        for name in self.registers.masks:
            sets[name] = _Set((1, 1), partial(self._set_mask, name))
            queries[name] = _Query((0, 0), partial(self._mask_text, name))
        sets |= {
            "*RST": _Set((0, 0), lambda _: setattr(self, "settings", Settings())),
            "*CLS": _Set((0, 0), lambda _: self.registers.clear()),
            "*TRG": _Set((0, 0), lambda _: self._triggers.single(self.settings)),
            "*WAI": _Set((0, 0), lambda _: None),
            "*OPC": _Set((0, 0), lambda _: self._operation_complete()),
            "*SAV": _Set((1, 1), self._save),
            "*RCL": _Set((1, 1), self._recall),
            "DLAY": _Set((3, 3), self._set_delay),
            "LINK": _Set((2, 2), self._set_link),
            "SPDL": _Set((2, 2), self._step),
            "DISP": _Set((2, 2), self._show),
            "LCAL": _Set((0, 0), lambda _: None),
            "REMT": _Set((0, 0), lambda _: None),
            "IFRS": _Set((1, 1), lambda _: self._lines.clear()),
            "XTRM": _Set((1, 3), self._set_reply_end),
        }
        queries |= {
            "*IDN": _Query((0, 0), lambda _: self.identity),
            "*OPC": _Query((0, 0), lambda _: "1"),
            "*TST": _Query((0, 0), lambda _: "0"),
            "*CAL": _Query((0, 0), lambda _: "0"),
            "*STB": _Query((0, 1), self._read_stb),
            "*ESR": _Query((0, 1), self._read_esr),
            "INSR": _Query((0, 1), self._read_insr),
            "LERR": _Query((0, 0), lambda _: str(self.registers.take_error())),
            "DLAY": _Query((1, 1), lambda p: self.settings.delays.text(channel(p[0]))),
            "LINK": _Query((1, 1), lambda p: self.settings.delays.text(channel(p[0])).split(",")[0]),
            "TIMB": _Query((0, 0), lambda _: "0"),
            "DISP": _Query((0, 0), lambda _: self._display),
        }
        return sets, queries

    def _set_row(self, name: str, parameters: list[str]) -> None:
        self.settings.set(name, parameters)

    def _row_text(self, name: str, parameters: list[str]) -> str:
        return self.settings.text(name, parameters)

    def _set_mask(self, name: str, parameters: list[str]) -> None:
        value = integer(parameters[0])
        if not 0 <= value <= 255:
            raise Refused(ILLEGAL_VALUE)
        self.registers.masks[name] = value

    def _mask_text(self, name: str, _: list[str]) -> str:
        return str(self.registers.masks[name])

    def _set_delay(self, parameters: list[str]) -> None:
        self._change_delay(channel(parameters[0]), channel(parameters[1]), number(parameters[2]))

    def _set_link(self, parameters: list[str]) -> None:
        self.settings.delays.link(channel(parameters[0]), channel(parameters[1]))

    def _step(self, parameters: list[str]) -> None:
        moved, up = channel(parameters[0]), integer(parameters[1])
        delays = self.settings.delays
        if moved not in delays.reference or up not in (0, 1):
            raise Refused(ILLEGAL_VALUE)
        step = self.settings.values["SSDL", moved] * (1 if up else -1)
        self._change_delay(moved, delays.reference[moved], Decimal(delays.delay_ps[moved]) / 10**12 + step)

    def _change_delay(self, moved: int, reference: int, delay_s: Decimal) -> None:
        self.settings.delays.set(moved, reference, delay_s)
        if self._triggers.running:
            self.registers.insr |= ABORTED  # a change of delay during a cycle aborts that cycle

    def _save(self, parameters: list[str]) -> None:
        if not 1 <= (memory := integer(parameters[0])) <= 9:
            raise Refused(ILLEGAL_VALUE)
        self._memories[memory] = self.settings.copy()

    def _recall(self, parameters: list[str]) -> None:
        memory = integer(parameters[0])
        if not 0 <= memory <= 9:
            raise Refused(ILLEGAL_VALUE)
        if memory and memory not in self._memories:
            raise Refused(RECALL_FAILED)
        self.settings = self._memories[memory].copy() if memory else Settings()

    def _operation_complete(self) -> None:
        self.registers.esr |= OPC

    def _show(self, parameters: list[str]) -> None:
        self._display = ",".join(str(integer(part)) for part in parameters)

    def _set_reply_end(self, parameters: list[str]) -> None:
        codes = [integer(part) for part in parameters]
        if not all(0 <= code <= 127 for code in codes):
            raise Refused(ILLEGAL_VALUE)
        self._reply_end = bytes(code for code in codes if code)

    def _read_stb(self, parameters: list[str]) -> str:
        self._triggers.update_status()
        busy = self._triggers.running
        stb = self.registers.status_byte(busy=busy, burst=busy and bool(self.settings.get("BURM")))
        return self._bits(lambda mask: stb & mask, parameters)

    def _read_esr(self, parameters: list[str]) -> str:
        return self._bits(self.registers.take_esr, parameters)

    def _read_insr(self, parameters: list[str]) -> str:
        self._triggers.update_status()
        return self._bits(self.registers.take_insr, parameters)

    @staticmethod
    def _bits(read: Callable[[int], int], parameters: list[str]) -> str:
        """Write a register, or one bit of it where its number is given."""
        if not parameters:
            return str(read(0xFF))
        bit = integer(parameters[0])
        if not 0 <= bit <= 7:
            raise Refused(ILLEGAL_VALUE)
        return str(read(1 << bit) >> bit)


def _check_count(parameters: list[str], allowed: tuple[int, int]) -> None:
    if len(parameters) < allowed[0]:
        raise Refused(TOO_FEW)
    if len(parameters) > allowed[1]:
        raise Refused(TOO_MANY)
