"""The gate in the laser's trigger line and its watchdog, as the sampling bridge offers them.

Source: protocol sheet ``sampling_bridge.md``, section 5.
"""

from __future__ import annotations

import struct

from picoradar.drivers.bridge import sbp
from picoradar.drivers.bridge.requests import BridgeRequests, gate_name, sampler_status
from picoradar.drivers.bridge.sbp import Gate, Request, StatusFlag
from picoradar.drivers.errors import DeviceFault
from picoradar.drivers.interfaces import WATCHDOG_S, SamplerStatus
from picoradar.drivers.links import UsbLink

WATCHDOG_MS = round(1000 * WATCHDOG_S)


class TriggerGate:
    """Lets triggers through to the laser while a live host feeds the watchdog.

    The watchdog closes the gate when `heartbeat` is not called within its time (1 s): the controller calls it every
    quarter of that from a timer of the clock, which also runs while this driver waits.

    Parameters
    ----------
    link : UsbLink
    """

    def __init__(self, link: UsbLink) -> None:
        self.link = link
        self._requests = BridgeRequests(link)
        self._watchdog_ms = WATCHDOG_MS
        self._counter = 0

    @property
    def watchdog_s(self) -> float:
        """Get the time limit of the watchdog (s): 1 s of wall time, as far as the device allows."""
        return self._watchdog_ms / 1000

    def gate_on(self) -> None:
        """Let triggers through to the laser; needs a heartbeat within the last second. Read back.

        Raises
        ------
        DeviceFault
            With the device's reason: interlock open, not configured, locked out, no heartbeat.
        """
        self._requests.order(Request.LASER, 1, sbp.LASER_KEY)
        if (gate := self._requests.status().gate) is not Gate.ON:
            raise DeviceFault(self.link.device, f"gate is {gate_name(gate)} after it was switched on")

    def gate_off(self) -> None:
        """Block the triggers to the laser, in every state of the device. Read back.

        Raises
        ------
        DeviceFault
            When the gate is still on.
        """
        self._requests.order(Request.LASER, 0)
        if self._requests.status().gate is Gate.ON:
            raise DeviceFault(self.link.device, "gate is still on after it was switched off", "cut the interlock chain")

    def clear_lockout(self) -> None:
        """Feed the watchdog and end a lock-out after watchdog or interlock; the gate stays closed.

        Raises
        ------
        DeviceFault
            When the interlock is still open.
        """
        self.heartbeat()
        self._requests.order(Request.LASER, 2, sbp.LASER_KEY)

    def heartbeat(self) -> None:
        """Feed the device's watchdog once."""
        self._counter = (self._counter + 1) & 0xFFFFFFFF
        self._requests.order(Request.HEARTBEAT, 0, struct.pack("<I", self._counter))

    def status(self) -> SamplerStatus:
        """Measure the present state; reads the device's error queue when something is in it."""
        status = self._requests.status()
        if status.flags & StatusFlag.ERROR_QUEUED:
            self._requests.noted.extend(self._requests.errors())
        problems = [str(entry) for entry in self._requests.noted]
        self._requests.noted.clear()
        if status.flags & StatusFlag.WATCHDOG_TRIPPED and not problems:
            problems = ["watchdog has tripped"]
        return sampler_status(status, "; ".join(problems))
