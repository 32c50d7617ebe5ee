"""Fault and status registers of the simulated Genesys supply with their events (protocol sheet ``tdk_genesys``).

Two status bits are no opposites: NFLT says that no fault which FENA enables is there now, FLT that FEVE holds one.
"""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.genesys import Fault, Status


class Registers:
    """Conditions as they are now, and events since they were last read.

    Parameters
    ----------
    announce : callable
        Called when SEVE goes from 00 to any bit (the device then sends ``!nn``).
    """

    def __init__(self, announce: Callable[[], None]) -> None:
        self.fault = Fault(0)
        self.fault_mask = Fault(0)
        self.status_mask = Status(0)
        self._conditions = Status(0)
        self._fault_events = Fault(0)
        self._status_events = Status(0)
        self._announce = announce

    @property
    def status(self) -> Status:
        """Get STAT as it is now."""
        status = self._conditions
        if not self.fault & self.fault_mask:
            status |= Status.NO_FAULT
        if self._fault_events:
            status |= Status.FAULT
        return status

    def update(self, fault: Fault, conditions: Status) -> None:
        """Take the faults and conditions of now; enabled bits that come up become events."""
        before = self.status
        self._fault_events |= fault & ~self.fault & self.fault_mask
        self.fault, self._conditions = fault, conditions
        was_quiet = not self._status_events
        self._status_events |= self.status & ~before & self.status_mask
        if was_quiet and self._status_events:
            self._announce()

    def clear_events(self) -> None:
        """Carry out ``CLS``."""
        self._fault_events = Fault(0)
        self._status_events = Status(0)

    def take_fault_events(self) -> Fault:
        """Return and clear FEVE."""
        events, self._fault_events = self._fault_events, Fault(0)
        return events

    def take_status_events(self) -> Status:
        """Return and clear SEVE."""
        events, self._status_events = self._status_events, Status(0)
        return events
