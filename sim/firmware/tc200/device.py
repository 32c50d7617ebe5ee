"""The firmware of a simulated Thorlabs TC200 heater controller (protocol sheet ``thorlabs_tc200``)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from picoradar.drivers.clock import Clock, Timer
from picoradar.sim.firmware.lines import LineReader
from picoradar.sim.wires import HeatPump

ANSWER_S = 0.002
STEP_S = 0.2
HEATER_OHM = 4.5
WATT_PER_GAIN = 0.05  # heating per degC of error and unit of gain
UNIT_BITS = {"c": 0x30, "k": 0x20, "f": 0x00}
SENSORS = {"ptc100": 0x00, "ptc1000": 0x04, "th10k": 0x08, "ntc10k": 0x0C}
ENABLED, CYCLE = 0x01, 0x02
UNKNOWN, RANGE = "CMD_NOT_DEFINED", "CMD_ARG_RANGE_ERR"
RANGES = {"pgain": (1, 250), "igain": (0, 250), "dgain": (0, 250), "beta": (2000, 6000), "pmax": (0.1, 18.0)}
_NUMBER = re.compile(r"-?\d{1,6}(\.\d{1,6})?", re.ASCII)


class Refused(Exception):
    """A command is answered with an error."""


class Tc200Firmware:
    """A heater controller on a serial line; heats a block, and cannot cool it.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    block : HeatPump
        What it heats and measures.
    """

    baud = 115200

    def __init__(self, clock: Clock, block: HeatPump) -> None:
        self.clock = clock
        self.block = block
        self.target_degc = 25.0
        self.max_degc = 200.0
        self.values: dict[str, float] = {"pgain": 125, "igain": 50, "dgain": 0, "beta": 3900, "pmax": 18.0}
        self.sensor = "ntc10k"
        self.unit = "c"
        self.cycle = False
        self._integral_w = 0.0
        self._timer: Timer | None = None
        self._lines = LineReader(b"\r", limit=64)
        self._send: Callable[[bytes, float], None] | None = None

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send

    def receive(self, data: bytes) -> None:
        """Take bytes that have arrived from the host: echo each line, answer it, and prompt."""
        for line in self._lines.feed(data):
            text = line.decode("latin-1").strip()
            try:
                answer = self._answer(text)
            except Refused as refusal:
                answer = f"Command error {refusal}\n\r"
            if self._send is not None:
                self._send(line + b"\r" + answer.encode("latin-1") + b"> ", ANSWER_S)

    def _answer(self, text: str) -> str:
        if not text:
            return ""
        if text == "ens":
            self._toggle()
            return ""
        if text == "stat?":
            return f"{self._status()} "
        name, equals, argument = text.partition("=")
        if equals:
            return self._set(name, argument)
        readings: dict[str, Callable[[], str]] = {
            "*idn?": lambda: "THORLABS TC200 VERSION 2.0",
            "tact?": lambda: self._temperature_text(self.block.temperature_degc()),
            "tset?": lambda: self._temperature_text(self.target_degc),
            "tmax?": lambda: f"{self.max_degc:.1f}",
            "pid?": lambda: " ".join(f"{self.values[name]:.0f}" for name in ("pgain", "igain", "dgain")),
            "pmax?": lambda: f"{self.values['pmax']:.1f}",
            "beta?": lambda: f"{self.values['beta']:.0f}",
            "sns?": lambda: f"Sensor = {self.sensor.upper()}, Beta = {self.values['beta']:.0f}",
        }
        if text not in readings:
            raise Refused(UNKNOWN)
        return readings[text]() + "\r"

    def _set(self, name: str, argument: str) -> str:
        if name == "mode" and argument in ("normal", "cycle"):
            self.cycle = argument == "cycle"
            if not self.cycle:
                raise Refused(RANGE)  # known defect of the device: it refuses what it has carried out
        elif name == "unit" and argument in UNIT_BITS:
            self.unit = argument
        elif name == "sns" and argument in SENSORS:
            self.sensor = argument
        elif name == "tset":
            self.target_degc = _within(argument, 20.0, self.max_degc)
        elif name == "tmax":
            self.max_degc = _within(argument, 20.0, 205.0)
        elif name in RANGES:
            self.values[name] = _within(argument, *RANGES[name])
        else:
            raise Refused(RANGE if name in ("mode", "unit", "sns") else UNKNOWN)
        return ""

    def _status(self) -> int:
        on = ENABLED if self._timer is not None else 0
        return on | (CYCLE if self.cycle else 0) | SENSORS[self.sensor] | UNIT_BITS[self.unit]

    def _temperature_text(self, degc: float) -> str:
        value = {"c": degc, "k": degc + 273.15, "f": degc * 1.8 + 32}[self.unit]
        return f"{value:.1f} {self.unit.upper()}"

    def _toggle(self) -> None:
        if self._timer is None:
            self._integral_w = 0.0
            self._timer = self.clock.every(STEP_S, self._step)
        else:
            self._timer.cancel()
            self._timer = None
            self.block.drive(0.0)

    def _step(self) -> None:
        error = self.target_degc - self.block.temperature_degc()
        max_w = self.values["pmax"]
        integral_w = self._integral_w + WATT_PER_GAIN * self.values["igain"] / 100 * error * STEP_S
        power_w = WATT_PER_GAIN * self.values["pgain"] * error + integral_w
        if 0 <= power_w <= max_w:  # anti-windup while the heater is at its limit
            self._integral_w = integral_w
        self.block.drive(math.sqrt(max(0.0, min(max_w, power_w)) / HEATER_OHM))


def _within(text: str, minimum: float, maximum: float) -> float:
    if not _NUMBER.fullmatch(text) or not minimum <= float(text) <= maximum:
        raise Refused(RANGE)
    return float(text)
