"""Fault and status registers of the simulated Genesys supply with their events (protocol sheet ``tdk_genesys``)."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.genesys import Fault, Status


class Registers:
    """Conditions as they are now, and events since they were last read.

    Parameters
    ----------
    announce : callable
        Called when an enabled event bit becomes set (the device then sends ``!nn``).
    """

    def __init__(self, announce: Callable[[], None]) -> None:
        self.fault = Fault(0)
        self.status = Status.NO_FAULT
        self.fault_mask = Fault(0)
        self.status_mask = Status(0)
        self._fault_events = Fault(0)
        self._status_events = Status(0)
        self._announce = announce

    def update(self, fault: Fault, status: Status) -> None:
        """Take the present conditions; bits that come up and are enabled become events."""
        new_faults = fault & ~self.fault & self.fault_mask & ~self._fault_events
        new_status = status & ~self.status & self.status_mask & ~self._status_events
        self.fault, self.status = fault, status
        self._fault_events |= new_faults
        self._status_events |= new_status
        if new_faults or new_status:
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
