"""Interlocks as data: a quantity, the band it must stay in, and what happens when it leaves it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from picoradar.drivers.interfaces import PulserStatus, SamplerStatus, TemperatureStatus
from picoradar.instrument.controller.exposure import Exposure
from picoradar.instrument.settings import TRANSMITTER_HEAT, Settings

Action = Literal["suspend", "abort", "off"]
INFINITE = math.inf
AVERAGE_CURRENT_A = 0.020  # section 2.6.1: a few mA to some 10 mA; 290 V on the bleeder draw 12 mA
MIN_HEARTBEAT_S = 0.4  # of the watchdog's second; the host beats every quarter of it
REFERENCE_WINDOW_PS = 1000.0  # it moves with drive voltage, rate and temperature; an echo is later than that
REFERENCE_MV = (3.0, 110.0)  # below, its instant is doubtful; above, the A/D is at its end
REFERENCE_SHARE = (0.7, 1.4)  # of that of the run's first line: beyond, the laser has left its working point


@dataclass(frozen=True)
class Readings:
    """What a poll of the bench found; None where no device was asked.

    Attributes
    ----------
    pulser, diode, sampler
        Status of the devices.
    mirrors_answer : bool
        The galvo controller has answered.
    reference_mv : float
        Lowest amplitude of the reference pulse in the last line; 0 when most points had none.
    reference_share : float
        The same as a share of that in the first line of the run.
    reference_ps : float
        Median instant of the reference pulse on the trace in the last line; None when most points had none.
    disk_lines : float
        Lines for which the disk of the recording still has room.
    """

    pulser: PulserStatus | None = None
    diode: TemperatureStatus | None = None
    sampler: SamplerStatus | None = None
    mirrors_answer: bool | None = None
    reference_mv: float | None = None
    reference_share: float | None = None
    reference_ps: float | None = None
    disk_lines: float | None = None


@dataclass(frozen=True)
class Interlock:
    """One condition for light.

    Attributes
    ----------
    name, unit : str
        For messages.
    quantity : callable
        Gets the value out of the readings; None when it was not measured.
    minimum, maximum : float
        Band in which the value must lie.
    action : str
        ``suspend``: laser off, go on by itself when it holds again; ``abort``: the scan ends; ``off``: the scan ends
        and the diode's controller is switched off as well.
    remedy : str
        What a person can do.
    emitting_only : bool
        Holds only while the laser is on.
    hysteresis : float
        Once it has tripped, the value must come this far inside the band before it holds again.
    hold_off_s : float
        A value outside the band for less than this does not trip.
    """

    name: str
    unit: str
    quantity: Callable[[Readings], float | None]
    minimum: float
    maximum: float
    action: Action
    remedy: str
    emitting_only: bool = False
    hysteresis: float = 0.0
    hold_off_s: float = 0.0

    def holds(self, value: float, *, tripped: bool) -> bool:
        """Get whether the value is in its band (NaN is not); the band is narrower while it is tripped."""
        inside = self.hysteresis if tripped else 0.0
        return self.minimum + inside <= value <= self.maximum - inside

    def describe(self, value: float) -> str:
        """Say value, band and remedy."""
        return " ".join(f"{value:g} {self.unit} is outside {self.band} {self.unit}; {self.remedy}".split())

    @property
    def band(self) -> str:
        """Get the band in words, without its unit."""
        if self.minimum == self.maximum:
            return f"{self.minimum:g}"
        return f"at least {self.minimum:g}" if self.maximum == INFINITE else f"{self.minimum:g} to {self.maximum:g}"


def _truth(value: bool | None) -> float | None:
    return None if value is None else float(value)


def interlocks(settings: Settings, exposure: Exposure) -> tuple[Interlock, ...]:
    """Get the table for one bench.

    Parameters
    ----------
    settings : Settings
        Target temperature, drive voltage and rate, from which the bands follow.
    exposure : Exposure
        Bound of the pulse energy, for the mean power at the measured rate.
    """
    return (*_of_bridge(settings, exposure), *_of_pulser(settings), *_of_diode(settings), *_of_line(settings))


def _of_bridge(settings: Settings, exposure: Exposure) -> tuple[Interlock, ...]:
    """Interlocks that every status of the bridge tells of."""
    prf_hz = settings.pulser.prf_hz
    return (
        Interlock(
            "interlock line", "", lambda r: _truth(r.sampler.interlock_closed) if r.sampler else None,
            1, 1, "abort", "close lid and key switch, see to the monitor of the mirrors",
        ),
        Interlock(
            "bridge clock", "", lambda r: _truth(r.sampler.clock_locked) if r.sampler else None,
            1, 1, "abort", "the delay clock of the bridge is not locked: ranges would be wrong; have it serviced",
        ),
        Interlock(
            "host heartbeat", "s", lambda r: r.sampler.watchdog_left_s if r.sampler else None,
            MIN_HEARTBEAT_S, INFINITE, "abort", "heartbeats reach the bridge late: this computer is overloaded",
            emitting_only=True,
        ),
        Interlock(
            "gate", "", lambda r: _truth(r.sampler.gate == "on") if r.sampler else None,
            1, 1, "abort", "the bridge has closed the gate: see its error", emitting_only=True,
        ),
        Interlock(
            "trigger rate", "Hz", lambda r: r.sampler.trigger_hz if r.sampler else None,
            prf_hz * 0.99, prf_hz * 1.01, "abort", "check the trigger cable between delay generator and bridge",
            emitting_only=True,
        ),
        Interlock(
            "mean power", "of class 1", lambda r: exposure.share(r.sampler.trigger_hz) if r.sampler else None,
            0, 1, "off", "light would leave class 1: lower rate or drive voltage", emitting_only=True,
        ),
    )  # fmt: skip


def _of_pulser(settings: Settings) -> tuple[Interlock, ...]:
    """Interlocks of the drive supply and the transmitter."""
    drive_v = settings.pulser.drive_v
    return (
        Interlock(
            "supply enable", "", lambda r: _truth(r.pulser.interlock_closed) if r.pulser else None,
            1, 1, "abort", "close the ENA terminals of the drive supply",
        ),
        Interlock(
            "drive voltage", "V", lambda r: r.pulser.measured_v if r.pulser else None,
            drive_v * 0.99, drive_v * 1.01, "abort", "check the drive supply", emitting_only=True,
        ),
        Interlock(
            "average current", "A", lambda r: r.pulser.measured_a if r.pulser else None,
            0, AVERAGE_CURRENT_A, "off", "the pulser draws too much: it may conduct between shots; let it be checked",
        ),
        Interlock(
            "pulser heat", "of its limit",
            lambda r: r.pulser.measured_v**2 * r.pulser.prf_hz / TRANSMITTER_HEAT.value if r.pulser else None,
            0, 1.02, "off", "drive voltage squared times rate overheats the transmitter", emitting_only=True,
        ),
    )  # fmt: skip


def _of_diode(settings: Settings) -> tuple[Interlock, ...]:
    """Interlocks of the diode's temperature."""
    target = settings.diode.target_degc
    return (
        Interlock(
            "diode regulation", "", lambda r: _truth(r.diode.regulating and not r.diode.problem) if r.diode else None,
            1, 1, "off", "the temperature controller has stopped: read its error, reset it",
        ),
        Interlock(
            "diode limits", "degC", lambda r: r.diode.temperature_degc if r.diode else None,
            target - 1.0, target + 1.0, "off", "check the temperature controller and the heat sink",
        ),
        Interlock(
            "diode temperature", "degC", lambda r: r.diode.temperature_degc if r.diode else None,
            target - 0.2, target + 0.2, "suspend", "the scan waits for the diode", hysteresis=0.05, hold_off_s=0.5,
        ),
    )  # fmt: skip


def _of_line(settings: Settings) -> tuple[Interlock, ...]:
    """Interlocks of mirrors, reference and recording, judged once a line."""
    reference_ps = settings.sampler.reference_ps
    return (
        Interlock(
            "mirrors", "", lambda r: _truth(r.mirrors_answer),
            1, 1, "abort", "the galvo controller does not answer: check its cable and supply",
        ),
        Interlock(
            "reference pulse", "mV", lambda r: r.reference_mv,
            *REFERENCE_MV, "abort", "check laser, trigger and reference fibre", emitting_only=True,
        ),
        Interlock(
            "laser output", "of the first line's", lambda r: r.reference_share,
            *REFERENCE_SHARE, "abort", "the reference has changed: check supply and laser", emitting_only=True,
        ),
        Interlock(
            "reference place", "ps", lambda r: r.reference_ps,
            reference_ps - REFERENCE_WINDOW_PS, reference_ps + REFERENCE_WINDOW_PS, "abort",
            "the first pulse is not the reference: check the reference fibre", emitting_only=True,
        ),
        Interlock(
            "disk space", "lines", lambda r: r.disk_lines,
            2, INFINITE, "suspend", "make room on the disk of the recording",
        ),
    )  # fmt: skip


def interlock_table(settings: Settings, exposure: Exposure) -> str:
    """Write the interlocks as a Markdown table, for the documents."""
    lines = [
        "| quantity | band | hysteresis | hold-off | when | action | what to do |",
        "|---|---|---|---|---|---|---|",
    ]
    for i in interlocks(settings, exposure):
        hysteresis = f"{i.hysteresis:g} {i.unit}" if i.hysteresis else ""
        hold_off = f"{i.hold_off_s:g} s" if i.hold_off_s else ""
        when = "laser on" if i.emitting_only else "always"
        lines.append(f"| {i.name} | {i.band} {i.unit} | {hysteresis} | {hold_off} | {when} | {i.action} | {i.remedy} |")
    return "\n".join(lines)
