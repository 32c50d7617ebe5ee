"""The serial side of a simulated TDK-Lambda GEN600-1.3: messages, address, check sums (sheet ``tdk_genesys``)."""

from __future__ import annotations

import re
from collections.abc import Callable

from picoradar.drivers.clock import Clock
from picoradar.drivers.genesys import END, Fault, Status, parse_rating
from picoradar.sim.firmware.genesys.supply import FILTERS_HZ, LOCAL, LOCKED_OUT, REMOTE, GenesysSupply, Refused
from picoradar.sim.firmware.genesys.text import ON_OFF, checksum, number, switch, two_hex_digits, without_backspaces
from picoradar.sim.firmware.lines import LineReader
from picoradar.sim.wires import InterlockChain

ANSWER_S = 0.010
LONGEST_MESSAGE = 64
REMOTES = {"0": LOCAL, "1": REMOTE, "2": LOCKED_OUT, LOCAL: LOCAL, REMOTE: REMOTE, LOCKED_OUT: LOCKED_OUT}
TAKES_REMOTE = ("PV", "PC", "OUT", "RST")
_MESSAGE = re.compile(r"([A-Z]+)(\?)?(?: +(\S+))?")


class GenesysFirmware:
    """A supply on a serial line; satisfies `picoradar.sim.wires.Supply`.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    interlock : InterlockChain
        Connected to the ENA terminals.
    address : int
        Address on the line, 0 to 30.
    model, serial_number : str
        As in ``IDN?`` and ``SN?``.
    """

    baud = 9600

    def __init__(
        self,
        clock: Clock,
        interlock: InterlockChain,
        address: int = 6,
        *,
        model: str = "GEN600-1.3",
        serial_number: str = "0123456",
    ) -> None:
        self.address = address
        self.model = model
        self.serial_number = serial_number
        self.supply = GenesysSupply(clock, interlock, *parse_rating(model), announce=self._announce)
        self._selected = False
        self._last = ""
        self._lines = LineReader(END, limit=LONGEST_MESSAGE)
        self._send: Callable[[bytes, float], None] | None = None
        self._queries = self._query_table()
        self._commands = self._command_table()

    def output_v(self) -> float:
        """Get the voltage at the terminals now."""
        return self.supply.output_v()

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send

    def receive(self, data: bytes) -> None:
        """Take bytes that have arrived from the host."""
        for line in self._lines.feed(data.replace(b"\n", b"")):
            self._take(line)

    def _take(self, line: bytes) -> None:
        """Answer one message, with a check sum if it has one; a unit that is not chosen stays silent."""
        text = without_backspaces(line.decode("latin-1"))
        body, dollar, digits = text.rpartition("$") if "$" in text else (text, "", "")
        if len(line) > LONGEST_MESSAGE:
            reply = "C01"
        elif dollar and digits.upper() != checksum(body):
            reply = "C04"
        else:
            reply = self._answer(body.strip().upper())
        if self._selected:
            self._reply(f"{reply}${checksum(reply)}" if dollar else reply)

    def _answer(self, text: str) -> str:
        if text == "\\":
            text = self._last
        self._last = text
        if not text:
            return "OK"
        match = _MESSAGE.fullmatch(text)
        if match is None:
            return "C01"
        name, question, argument = match.groups()
        try:
            if name == "ADR" and not question:
                self._select(argument)
                return "OK"
            if not self._selected:
                return ""  # a message for another unit is not carried out
            return self._ask(name, argument) if question else self._set(name, argument)
        except Refused as refusal:
            return str(refusal)

    def _select(self, argument: str | None) -> None:
        if argument is None:
            raise Refused("C02")
        if not argument.isdecimal() or int(argument) > 30:
            raise Refused("C03")
        self._selected = int(argument) == self.address

    def _ask(self, name: str, argument: str | None) -> str:
        if name not in self._queries:
            raise Refused("C01")
        if argument is not None:
            raise Refused("C03")
        return self._queries[name]()

    def _set(self, name: str, argument: str | None) -> str:
        name, argument = {LOCAL: ("RMT", "0"), REMOTE: ("RMT", "1"), LOCKED_OUT: ("RMT", "2")}.get(
            name, (name, argument)
        )
        if name not in self._commands:
            raise Refused("C01")
        takes_argument, run = self._commands[name]
        if takes_argument and argument is None:
            raise Refused("C02")
        if not takes_argument and argument is not None:
            raise Refused("C03")
        run(argument or "")
        if name in TAKES_REMOTE and self.supply.remote == LOCAL:
            self.supply.set_remote(REMOTE)
        return "OK"

    def _query_table(self) -> dict[str, Callable[[], str]]:
        supply, registers = self.supply, self.supply.registers
        return {
            "IDN": lambda: f"LAMBDA,{self.model}",
            "REV": lambda: "1U-4.3",
            "SN": lambda: self.serial_number,
            "DATE": lambda: "2010/03/15",
            "RMT": lambda: supply.remote,
            "PV": lambda: supply.settings.voltage_text,
            "MV": lambda: f"{supply.measured_v:06.2f}",
            "PC": lambda: supply.settings.current_text,
            "MC": lambda: f"{supply.measured_a:.4f}",
            "DVC": self._all_values,
            "STT": self._state,
            "MODE": lambda: "OFF" if not supply.is_on else "CC" if supply.limits_current else "CV",
            "OUT": lambda: ON_OFF[supply.is_on],
            "OVP": lambda: supply.settings.overvoltage_text,
            "UVL": lambda: supply.settings.undervoltage_text,
            "FLD": lambda: ON_OFF[supply.settings.foldback],
            "FBD": lambda: f"{supply.foldback_delay:02d}",
            "AST": lambda: ON_OFF[supply.settings.auto_start],
            "FILTER": lambda: str(supply.filter_hz),
            "FENA": lambda: f"{registers.fault_mask:02X}",
            "SENA": lambda: f"{registers.status_mask:02X}",
            "FLT": lambda: f"{registers.fault:02X}",
            "STAT": lambda: f"{registers.status:02X}",
            "FEVE": lambda: f"{registers.take_fault_events():02X}",
            "SEVE": lambda: f"{registers.take_status_events():02X}",
        }

    def _command_table(self) -> dict[str, tuple[bool, Callable[[str], None]]]:
        """Build the table of set commands: whether each takes an argument, and what it does."""
        supply = self.supply
        return {
            "CLS": (False, lambda _: supply.registers.clear_events()),
            "RST": (False, lambda _: supply.reset()),
            "OVM": (False, lambda _: supply.set_highest_overvoltage()),
            "SAV": (False, lambda _: supply.save()),
            "RCL": (False, lambda _: supply.recall()),
            "FBDRST": (False, lambda _: self._set_foldback_delay("0")),
            "RMT": (True, self._set_remote),
            "PV": (True, lambda text: supply.set_voltage(number(text), text)),
            "PC": (True, lambda text: supply.set_current(number(text), text)),
            "OUT": (True, lambda text: supply.switch(on=switch(text))),
            "OVP": (True, lambda text: supply.set_overvoltage(number(text), text)),
            "UVL": (True, lambda text: supply.set_undervoltage(number(text), text)),
            "FLD": (True, lambda text: supply.change(foldback=switch(text))),
            "FBD": (True, self._set_foldback_delay),
            "AST": (True, lambda text: supply.change(auto_start=switch(text))),
            "FILTER": (True, self._set_filter),
            "FENA": (True, self._enable_faults),
            "SENA": (True, self._enable_status),
        }

    def _all_values(self) -> str:
        supply, settings = self.supply, self.supply.settings
        return (
            f"{supply.measured_v:06.2f},{settings.voltage_v:06.2f},{supply.measured_a:.4f},{settings.current_a:.4f},"
            f"{settings.overvoltage_v:05.1f},{settings.undervoltage_v:05.1f}"
        )

    def _state(self) -> str:
        supply, settings, registers = self.supply, self.supply.settings, self.supply.registers
        return (
            f"MV({supply.measured_v:06.2f}),PV({settings.voltage_text}),MC({supply.measured_a:.4f}),"
            f"PC({settings.current_text}),SR({registers.status:02X}),FR({registers.fault:02X})"
        )

    def _set_remote(self, text: str) -> None:
        if text not in REMOTES:
            raise Refused("C03")
        self.supply.set_remote(REMOTES[text])

    def _set_foldback_delay(self, text: str) -> None:
        if not text.isdecimal():
            raise Refused("C03")
        if int(text) > 255:
            raise Refused("C05")
        self.supply.foldback_delay = int(text)

    def _set_filter(self, text: str) -> None:
        if not text.isdecimal() or int(text) not in FILTERS_HZ:
            raise Refused("C03")
        self.supply.filter_hz = int(text)

    def _enable_faults(self, text: str) -> None:
        self.supply.registers.fault_mask = Fault(two_hex_digits(text))

    def _enable_status(self, text: str) -> None:
        self.supply.registers.status_mask = Status(two_hex_digits(text))

    def _announce(self) -> None:
        self._reply(f"!{self.address:02d}")

    def _reply(self, text: str) -> None:
        if self._send is not None:
            self._send(text.encode("ascii") + END, ANSWER_S)
