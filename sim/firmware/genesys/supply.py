"""The simulated Genesys supply behind its command set: settings and their cross rules, faults, output.

The ENA terminals are connected to the interlock chain. After an interlock trip the output stays off, unless
auto-start is on. ``OUT 1`` clears a foldback or over-voltage trip and the panel's output-off; it is refused
while mains, temperature, rear shut-off or interlock forbid it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Unpack

from picoradar.drivers.clock import Clock, Timer
from picoradar.drivers.genesys import Fault, Status
from picoradar.sim.firmware.genesys.output import LOAD_OHM, Output
from picoradar.sim.firmware.genesys.registers import Registers
from picoradar.sim.firmware.genesys.settings import Changes, Settings
from picoradar.sim.wires import InterlockChain

GAIN_ERROR = 3.5e-5  # of the voltage read-back
FOLDBACK_S = 0.25
ROUNDING_V = 1e-9
LOCAL, REMOTE, LOCKED_OUT = "LOC", "REM", "LLO"
CLEARED_BY_ON = Fault.FOLDBACK | Fault.OVER_VOLTAGE | Fault.PANEL_OFF
FILTERS_HZ = (18, 23, 46)


class Refused(Exception):
    """A message is answered with an error code of the sheet."""


class GenesysSupply:
    """One supply without its serial line; satisfies `picoradar.sim.wires.Supply`.

    Parameters
    ----------
    clock, interlock
        As of the firmware.
    rated_v, rated_a : float
        Rating.
    announce : callable
        Called when the first enabled status event comes.
    """

    def __init__(
        self,
        clock: Clock,
        interlock: InterlockChain,
        rated_v: float,
        rated_a: float,
        announce: Callable[[], None],
    ) -> None:
        self.clock = clock
        self.interlock = interlock
        self.rated_v = rated_v
        self.rated_a = rated_a
        self.settings = self._defaults()
        self.registers = Registers(announce)
        self.is_on = False
        self.remote = REMOTE
        self.filter_hz = FILTERS_HZ[0]
        self.foldback_delay = 0
        self._output = Output(clock, rated_v)
        self._saved = self.settings
        self._folded = False
        self._outside = Fault(0)
        self._foldback_timer: Timer | None = None
        interlock.on_change(self._interlock_changed)
        self._refresh()

    def output_v(self) -> float:
        """Get the voltage at the terminals now."""
        return self._output.voltage_v()

    @property
    def measured_v(self) -> float:
        """Get the voltage as the supply itself measures it."""
        return self.output_v() * (1 + GAIN_ERROR)

    @property
    def measured_a(self) -> float:
        """Get the current as the supply itself measures it."""
        return self.output_v() / LOAD_OHM

    @property
    def limits_current(self) -> bool:
        """Get whether the current limit keeps the voltage below its set point."""
        return self.settings.current_a * LOAD_OHM < self.settings.voltage_v

    def fail(self, fault: Fault) -> None:
        """Let something go wrong (mains, heat, over-voltage, rear shut-off, panel); ``Fault(0)`` ends it."""
        self._outside = fault
        self._refresh()

    def set_voltage(self, volts: float, text: str) -> None:
        """Carry out ``PV``."""
        if volts > 1.05 * self.rated_v or volts > 0.95 * self.settings.overvoltage_v + ROUNDING_V:
            raise Refused("E01")
        if volts < self.settings.undervoltage_v:
            raise Refused("E02")
        self.change(voltage_text=text)

    def set_current(self, amperes: float, text: str) -> None:
        """Carry out ``PC``."""
        if amperes > 1.05 * self.rated_a:
            raise Refused("C05")
        self.change(current_text=text)

    def set_overvoltage(self, volts: float, text: str) -> None:
        """Carry out ``OVP``."""
        if not 5 <= volts <= 1.1 * self.rated_v + ROUNDING_V:
            raise Refused("C05")
        if volts < 1.05 * self.settings.voltage_v - ROUNDING_V:
            raise Refused("E04")
        self.change(overvoltage_text=text)

    def set_highest_overvoltage(self) -> None:
        """Carry out ``OVM``."""
        self.change(overvoltage_text=self._defaults().overvoltage_text)

    def set_undervoltage(self, volts: float, text: str) -> None:
        """Carry out ``UVL``."""
        if volts > 0.95 * self.rated_v:
            raise Refused("C05")
        if volts > self.settings.voltage_v + ROUNDING_V:
            raise Refused("E06")
        self.change(undervoltage_text=text)

    def set_remote(self, who: str) -> None:
        """Carry out ``RMT``."""
        self.remote = who
        self._refresh()

    def switch(self, *, on: bool) -> None:
        """Carry out ``OUT``."""
        if on and self._faults() & ~CLEARED_BY_ON:
            raise Refused("E07")
        if on:
            self._folded = False
            self._outside &= ~CLEARED_BY_ON
        self.is_on = on
        self._refresh()

    def change(self, **changes: Unpack[Changes]) -> None:
        """Change settings that need no check of their own."""
        self.settings = replace(self.settings, **changes)
        self._refresh()

    def reset(self) -> None:
        """Carry out ``RST``."""
        self.settings = self._defaults()
        self.remote = REMOTE
        self._folded = False
        self.is_on = False
        self._refresh()

    def save(self) -> None:
        """Carry out ``SAV``."""
        self._saved = self.settings

    def recall(self) -> None:
        """Carry out ``RCL``; the output goes off."""
        self.settings = self._saved
        self.is_on = False
        self._refresh()

    def _defaults(self) -> Settings:
        return Settings(overvoltage_text=f"{1.1 * self.rated_v:05.1f}")

    def _interlock_changed(self) -> None:
        if self.interlock.closed and self.settings.auto_start and not self._folded:
            self.is_on = True
        self._refresh()

    def _faults(self) -> Fault:
        found = self._outside
        if not self.interlock.closed:
            found |= Fault.INTERLOCK
        if self._folded:
            found |= Fault.FOLDBACK
        return found

    def _refresh(self) -> None:
        """Bring output, foldback timer and registers to what settings and faults say."""
        fault = self._faults()
        if fault:
            self.is_on = False
        settings, limited = self.settings, self.limits_current
        self._output.steer(min(settings.voltage_v, settings.current_a * LOAD_OHM) if self.is_on else 0.0)
        self._watch_foldback(due=self.is_on and limited and settings.foldback)
        status = Status(0)
        if self.is_on:
            status |= Status.CONSTANT_CURRENT if limited else Status.CONSTANT_VOLTAGE
        if settings.auto_start:
            status |= Status.AUTO_START
        if settings.foldback:
            status |= Status.FOLDBACK_ENABLED
        if self.remote == LOCAL:
            status |= Status.LOCAL
        self.registers.update(fault, status)

    def _watch_foldback(self, *, due: bool) -> None:
        if due and self._foldback_timer is None:
            when = self.clock.now() + FOLDBACK_S + 0.1 * self.foldback_delay
            self._foldback_timer = self.clock.call_at(when, self._fold)
        elif not due and self._foldback_timer is not None:
            self._foldback_timer.cancel()
            self._foldback_timer = None

    def _fold(self) -> None:
        self._foldback_timer = None
        self._folded = True
        self._refresh()
