"""Interlocks as data: a quantity, the band it must stay in, and what happens when it leaves it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.interfaces import PulserStatus, SamplerStatus, TemperatureStatus
from instrument.errors import InterlockTripped
from instrument.settings import Settings


@dataclass(frozen=True)
class Readings:
    """What one look at the bench found; None where a device was not asked."""

    pulser: PulserStatus | None = None
    diode: TemperatureStatus | None = None
    sampler: SamplerStatus | None = None


@dataclass(frozen=True)
class Interlock:
    """One condition for light.

    Attributes
    ----------
    name, unit : str
        For messages.
    quantity : callable
        Gets the value out of the readings; None when it was not measured.
    least, most : float
        Band in which the value must lie.
    emitting_only : bool
        Holds only while the laser is on.
    remedy : str
        What a person can do.
    """

    name: str
    unit: str
    quantity: Callable[[Readings], float | None]
    least: float
    most: float
    emitting_only: bool
    remedy: str

    def check(self, readings: Readings, *, emitting: bool) -> None:
        """Refuse a value outside the band (NaN included).

        Raises
        ------
        InterlockTripped
        """
        value = self.quantity(readings)
        if value is None or (self.emitting_only and not emitting):
            return
        if not self.least <= value <= self.most:
            raise InterlockTripped(
                self.name,
                f"{value:g} {self.unit} is outside {self.least:g} to {self.most:g} {self.unit}; {self.remedy}".replace(
                    "  ", " "
                ),
            )


def interlocks(settings: Settings) -> tuple[Interlock, ...]:
    """Get the table for one bench.

    The bands follow the design: diode within 1 K of its target, drive within 1 %, PRF within 1 %.
    """
    target, drive_v, prf_hz = settings.diode.target_degc, settings.pulser.drive_v, settings.pulser.prf_hz
    return (
        Interlock(
            "diode temperature", "degC", lambda r: r.diode.temperature_degc if r.diode else None,
            target - 1.0, target + 1.0, False, "check the temperature controller and the heat sink",
        ),
        Interlock(
            "diode regulation", "", lambda r: float(r.diode.regulating and not r.diode.problem) if r.diode else None,
            1, 1, False, "the temperature controller has stopped: read its error, reset it",
        ),
        Interlock(
            "interlock line", "", lambda r: float(r.sampler.interlock_closed) if r.sampler else None,
            1, 1, False, "close lid and key switch",
        ),
        Interlock(
            "supply enable", "", lambda r: float(r.pulser.interlock_closed) if r.pulser else None,
            1, 1, False, "close the ENA terminals of the drive supply",
        ),
        Interlock(
            "drive voltage", "V", lambda r: r.pulser.measured_v if r.pulser else None,
            drive_v * 0.99, drive_v * 1.01, True, "check the drive supply",
        ),
        Interlock(
            "trigger rate", "Hz", lambda r: r.sampler.trigger_hz if r.sampler else None,
            prf_hz * 0.99, prf_hz * 1.01, True, "check the trigger cable between delay generator and bridge",
        ),
        Interlock(
            "gate", "", lambda r: float(r.sampler.gate == "on") if r.sampler else None,
            1, 1, True, "the bridge has closed the gate: see its error",
        ),
    )  # fmt: skip


def check_all(table: tuple[Interlock, ...], readings: Readings, *, emitting: bool) -> None:
    """Check every interlock of the table; the first that does not hold is raised.

    Raises
    ------
    InterlockTripped
    """
    for interlock in table:
        interlock.check(readings, emitting=emitting)
