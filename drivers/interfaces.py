"""What the controller may rely on, whatever maker a device is from.

Each protocol is small on purpose: another maker's device is one new module that satisfies it, and one
line in the settings. Every verb that switches something reads the result back from the device before
it returns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import CodeScale, Trace


@dataclass(frozen=True)
class Identity:
    """Who answers on a link.

    Attributes
    ----------
    model, serial_number, firmware : str
        As the device reports them; an empty string where it does not tell.
    """

    model: str
    serial_number: str = ""
    firmware: str = ""

    def __str__(self) -> str:
        parts = [self.model, f"s/n {self.serial_number}" if self.serial_number else "", self.firmware]
        return ", ".join(p for p in parts if p)


class Device(Protocol):
    """What every device can do."""

    def open(self) -> None:
        """Open the link, identify the device and bring it into its safe state.

        Raises
        ------
        DeviceError
            Of the kind that fits: `LinkLost`, `Timeout`, `ProtocolError`, `DeviceFault`.
        """

    def close(self) -> None:
        """Bring the device into its safe state as far as the link allows, and close the link."""

    def identify(self) -> Identity:
        """Get maker's model, serial number and firmware."""


PRF_HZ = (20e3, 240e3)
DRIVE_V = (240.0, 330.0)
"""Rate and drive voltage that the pulser takes (docs/devices.md); below 234 V the diode does not give its short pulse
(dissertation, figure 2.5)."""


@dataclass(frozen=True)
class PulserStatus:
    """One look at the pulser.

    Attributes
    ----------
    triggers_on, output_on, interlock_closed : bool
    prf_hz : float
    drive_v, measured_v, measured_a : float
        Set point and read-back of the drive supply.
    problem : str
        What the devices report as fault; empty when nothing is wrong.
    """

    triggers_on: bool
    output_on: bool
    interlock_closed: bool
    prf_hz: float
    drive_v: float
    measured_v: float
    measured_a: float
    problem: str = ""


class Pulser(Device, Protocol):
    """Trigger source and drive supply of the laser, as one."""

    def configure(self, *, prf_hz: float, drive_v: float) -> None:
        """Set rate (Hz) and drive voltage (V) with everything off, and read both back.

        Raises
        ------
        LimitError
            When a value is out of range; nothing was sent.
        """

    def on(self) -> None:
        """Switch the supply on, wait until it is within 1 %, then start the triggers; each step read back."""

    def off(self) -> None:
        """Stop the triggers, then the supply; both are tried even if one fails, each is read back.

        Raises
        ------
        DeviceError
            When one of them could not be verified off.
        """

    def status(self) -> PulserStatus:
        """Measure the present state of both devices."""


@dataclass(frozen=True)
class TemperatureStatus:
    """One look at the temperature controller: ``temperature_degc``, ``target_degc``, and whether it
    regulates, is stable by its own measure, and what it reports as a fault (empty: nothing)."""

    temperature_degc: float
    target_degc: float
    regulating: bool
    stable: bool
    problem: str = ""


class TemperatureController(Device, Protocol):
    """Keeps the laser diode at its temperature."""

    def regulate(self, target_degc: float) -> None:
        """Set the target (degC) and switch the output on; both read back."""

    def off(self) -> None:
        """Switch the output off; read back."""

    def status(self) -> TemperatureStatus:
        """Measure the present state."""


class Galvo(Device, Protocol):
    """Two mirrors, moved by integer codes."""

    @property
    def codes(self) -> int:
        """Get the number of codes an axis has; the centre is ``codes // 2``."""

    def move(self, x_code: int, y_code: int) -> None:
        """Send the beam to a place; returns when the controller has taken it (the mirrors still settle)."""

    def ready(self) -> bool:
        """Get whether the controller answers and can take the next place."""

    def park(self) -> None:
        """Send the mirrors to the centre, and verify that the controller has carried it out."""


@dataclass(frozen=True)
class SweepSettings:
    """How one record is sampled.

    Attributes
    ----------
    start_ps, step_ps : float
        Sampling instant of the first sample after the trigger, and step from shot to shot.
    samples : int
        Samples in a sweep, one laser shot each.
    averages : int
        Sweeps added into one record.
    settle_shots : int
        Shots thrown away before each sweep.
    prf_hz : float
        Rate of the trigger that comes from outside.
    """

    start_ps: float
    step_ps: float
    samples: int
    averages: int
    settle_shots: int
    prf_hz: float

    @property
    def times_ps(self) -> NDArray[np.float64]:
        """Get the (S,) sampling instants that this asks for; a device rounds them to its own grid."""
        return np.asarray(self.start_ps + self.step_ps * np.arange(self.samples), dtype=np.float64)

    @property
    def record_s(self) -> float:
        """Get how long one record takes (s): averages x (settle + samples) / PRF."""
        return self.averages * (self.settle_shots + self.samples) / self.prf_hz


@dataclass(frozen=True)
class Record:
    """One averaged trace.

    Attributes
    ----------
    run_id, number : int
        Which run it belongs to and its place in it.
    sums : (S,) uint16 or uint32 array
        Sum of the A/D codes over the sweeps, as the device sent it.
    sweeps : int
        Sweeps in the sum.
    times_ps : (S,) float array
        Sampling instants after the trigger.
    zero_code, mv_per_code : float
        Scale of the A/D.
    clipped, trigger_lost : bool
        What the device noticed.
    device_time_us : int
        Start of the record since START.
    """

    run_id: int
    number: int
    sums: NDArray[np.unsignedinteger]
    sweeps: int
    times_ps: NDArray[np.float64]
    zero_code: float
    mv_per_code: float
    clipped: bool
    trigger_lost: bool
    device_time_us: int

    @property
    def trace(self) -> Trace:
        """Get codes, scale and instants alone, as they go on to ranging."""
        return Trace(self.sums, self.sweeps, self.times_ps, CodeScale(self.zero_code, self.mv_per_code))

    @property
    def trace_mv(self) -> NDArray[np.float64]:
        """Get the (S,) mean trace at the photodiode bridge, in mV."""
        return self.trace.mv


@dataclass(frozen=True)
class WindowRecord:
    """One record that was taken in windows.

    Attributes
    ----------
    number : int
        Place in the run.
    windows : tuple of Record
        One averaged piece of the trace for each window, in the order of the window table.
    """

    number: int
    windows: tuple[Record, ...]


WATCHDOG_S = 1.0
"""Without a heartbeat for this long (s of the wall), a sampler closes the gate by itself (SBP 1.0, section 5)."""


@dataclass(frozen=True)
class SamplerStatus:
    """One look at the sampler: what it does, its trigger, its gate and its watchdog.

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
        What it reports as fault; empty when nothing is wrong.
    clock_locked : bool
        Whether its delay clock, the ruler of all ranges, is locked.
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
        """Set how records are taken, and read it back."""

    def take(self, run_id: int, records: int = 1) -> list[Record]:
        """Take that many records (each of `SweepSettings.record_s`) in one run and return them.

        Raises
        ------
        DeviceError
            When data are lost or late, after the retries of the driver.
        """

    def gate_on(self) -> None:
        """Open the way for triggers to the laser; needs a live heartbeat; read back."""

    def gate_off(self) -> None:
        """Close the way for triggers to the laser; read back. Accepted in every state."""

    def heartbeat(self) -> None:
        """Feed the device's watchdog once."""

    def clear_lockout(self) -> None:
        """End a lock-out after watchdog or interlock; needs a closed interlock, the gate stays closed."""

    def stop(self) -> None:
        """End the run at once and empty the queue."""

    def status(self) -> SamplerStatus:
        """Measure the present state."""
