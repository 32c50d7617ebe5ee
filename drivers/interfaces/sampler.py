"""The sampler: takes records, and owns the trigger gate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from picoradar.drivers.interfaces.device import Device
from picoradar.drivers.interfaces.records import Record, SweepSettings

WATCHDOG_S = 1.0
"""Without a heartbeat for this long (s of the wall), a sampler closes the gate by itself (SBP 1.0, section 5)."""


@dataclass(frozen=True)
class SamplerStatus:
    """State of the sampler at one moment, with its trigger, gate and watchdog.

    Attributes
    ----------
    state : str
        ``idle``, ``wait``, ``running``, ``stopping`` or ``fault``.
    gate : str
        ``off``, ``on`` or ``locked``.
    interlock_closed, trigger_present : bool
    trigger_hz : float
    watchdog_left_s : float
    problem : str
        What it reports as a fault; empty when nothing is wrong.
    clock_locked : bool
        Whether its delay clock, the time base of all ranges, is locked.
    """

    state: str
    gate: str
    interlock_closed: bool
    trigger_present: bool
    trigger_hz: float
    watchdog_left_s: float
    problem: str = ""
    clock_locked: bool = True


class Sampler(Device, Protocol):
    """Takes records, and owns the gate in the laser's trigger line."""

    @property
    def zero_code(self) -> float:
        """Get the A/D code of 0 V."""

    @property
    def mv_per_code(self) -> float:
        """Get the size of an A/D code at the photodiode bridge, mV."""

    def configure(self, sweep: SweepSettings) -> None:
        """Set how records are taken, and read the configuration back."""

    def take(self, run_id: int, records: int = 1) -> list[Record]:
        """Take that many records (each of `SweepSettings.record_s`) in one run and return them.

        Raises
        ------
        DeviceError
            When data are lost or late, after the retries of the driver.
        """

    def gate_on(self) -> None:
        """Let triggers through to the laser; needs a live heartbeat; read back."""

    def gate_off(self) -> None:
        """Block the triggers to the laser; read back. Accepted in every state."""

    def heartbeat(self) -> None:
        """Feed the device's watchdog once."""

    def clear_lockout(self) -> None:
        """End a lock-out after watchdog or interlock; needs a closed interlock, the gate stays closed."""

    def stop(self) -> None:
        """End the run at once and empty the queue."""

    def status(self) -> SamplerStatus:
        """Measure the present state."""
