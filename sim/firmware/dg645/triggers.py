"""Trigger engine of the simulated DG645: which rate comes out, and which status bits it sets.

Triggers are counted, not generated one by one: the rate follows from the settings, and from the time since the last
update follows whether at least one trigger came.
"""

from __future__ import annotations

import math

from picoradar.drivers.clock import Clock
from picoradar.sim.firmware.dg645.registers import Registers
from picoradar.sim.firmware.dg645.settings import Settings
from picoradar.sim.wires import InterlockChain, TriggerLine

TRIGGERED, RATE, END_OF_DELAY, END_OF_BURST, INHIBITED = 0x01, 0x02, 0x04, 0x08, 0x10
INTERNAL, LINE = 0, 6
LINE_HZ = 50.0


class TriggerEngine:
    """Turns settings into the rate on output AB.

    Parameters
    ----------
    clock, trigger, interlock
        As of the firmware.
    registers : Registers
        Where INSR bits are set.
    """

    def __init__(self, clock: Clock, trigger: TriggerLine, interlock: InterlockChain, registers: Registers) -> None:
        self.clock = clock
        self.trigger = trigger
        self.interlock = interlock
        self.registers = registers
        self._asked_hz = 0.0
        self._bits = 0
        self._since = clock.now()

    @property
    def running(self) -> bool:
        """Get whether triggers come by themselves."""
        return self._asked_hz > 0

    def update_status(self) -> None:
        """Set the status bits of what has happened since the last call."""
        now = self.clock.now()
        if (now - self._since) * self._asked_hz >= 1:
            self.registers.insr |= self._bits
            self._since = now

    def single(self, settings: Settings) -> None:
        """Carry out one cycle by command."""
        inhibited = not self.interlock.closed and settings.get("INHB") == 1
        self.registers.insr |= INHIBITED if inhibited else TRIGGERED | END_OF_DELAY

    def apply(self, settings: Settings) -> None:
        """Take new settings or a change of the interlock: compute rate and bits from now on."""
        self.update_status()
        self._since = self.clock.now()
        source = settings.get("TSRC")
        self._asked_hz = {INTERNAL: settings.get("TRAT"), LINE: LINE_HZ}.get(int(source), 0.0)
        inhibit = 0 if self.interlock.closed else int(settings.get("INHB"))
        if not self._asked_hz or inhibit == 1:
            self._bits = INHIBITED
            self.trigger.rate_hz = 0.0
            return
        self._bits = TRIGGERED | END_OF_DELAY
        offered_hz, cycle_s, pulses = self._asked_hz, settings.delays.longest_s, 1.0
        if settings.get("BURM"):
            pulses = settings.get("BURC")
            cycle_s += settings.get("BURD") + (pulses - 1) * settings.get("BURP")
            self._bits |= END_OF_BURST
        if settings.get("ADVT"):
            offered_hz /= settings.get("PRES", 0)
            cycle_s = max(cycle_s, settings.get("HOLD"))
            pulses /= settings.get("PRES", 1)
        # A trigger that comes while the cycle still runs is ignored and sets RATE.
        periods = math.floor(cycle_s * offered_hz) + 1
        if periods > 1:
            self._bits |= RATE
        self.trigger.rate_hz = 0.0 if inhibit else offered_hz / periods * pulses
        if inhibit:
            self._bits |= INHIBITED
