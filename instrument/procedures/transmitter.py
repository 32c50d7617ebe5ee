"""`transmitter`: power, width and rise time of the laser pulse against voltage and temperature (figures 2.8 to 2.12).

A fast photodetector on the oscilloscope gives the form of the pulse, a power meter at the exit its energy. Where the
resistor R_M is wired to the oscilloscope, the current pulse at 20 and 80 kHz is measured, too (figure 2.7).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.errors import BadInput, InterlockTripped, Interrupted
from picoradar.instrument.procedures.current_pulse import (
    Current,
    current_figures,
    current_finding,
    draw_current,
    measured_current,
)
from picoradar.instrument.procedures.station.findings import refused
from picoradar.instrument.procedures.station.light import SWEEP, Light, LightJob, NoStore
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings
from picoradar.instrument.procedures.station.station import Station
from picoradar.instrument.settings import TRANSMITTER_HEAT, max_drive_v, override

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

NAME = "transmitter"
VOLTS = tuple(float(v) for v in range(240, 331, 10))
DEGC = tuple(float(t) for t in range(25, 16, -1))  # down to where a Peltier element may give up
MIN_DEGC = min(DEGC)
REACH_LIMIT_S = 600.0  # for one temperature
COOL_HZ = 20_000.0  # of the sweep of the voltage: there the transmitter never overheats
METER_SHARE = 0.02  # uncertainty of the power meter from reading to reading
WORK_HZ = 80_000.0
WORK_V, WORK_DEGC = 290.0, 23.0  # where the other quantity stands while one is swept
HEAT_RESERVE = 0.95
MIN_PEAK_W, LARGEST_FWHM_PS = 100.0, 60.0
EXIT_TRANSMISSION = 0.62  # from the diode to the power meter
NO_LIGHT_MV = 2.0  # of the detector
REMEDY = "Open the lid, put detector and power meter at the exit, see to the trigger cable, and run this again."


class Pulse(NamedTuple):
    """One working point: ``drive_v``, ``degc``, peak power at the diode (W), FWHM and rise time (ps), mean power at the
    exit (mW) and its energy a pulse (nJ)."""

    drive_v: float
    degc: float
    peak_w: float
    fwhm_ps: float
    rise_ps: float
    mean_mw: float
    energy_nj: float


def run(station: Station, *, volts: tuple[float, ...] = VOLTS, degc: tuple[float, ...] = DEGC) -> Outcome:
    """Sweep drive voltage and temperature, and find the working point within the limits.

    Parameters
    ----------
    station : Station
        With light meters.
    volts, degc : tuples of float
        What is swept.

    Raises
    ------
    BadInput
        When the bench has no light meters.
    InterlockTripped
        When the light of a working point may exceed class 1, or the diode does not reach its working temperature.
    """
    meters = station.meters
    if meters is None:
        raise BadInput(
            "bench transmitter needs an oscilloscope with a fast detector, and a power meter (docs/bench.md)"
        )
    points = [(v, WORK_DEGC, COOL_HZ) for v in volts] + [(WORK_V, t, WORK_HZ) for t in degc]
    pulses: list[Pulse] = []
    currents: list[Current | None] = []
    meters.open()
    try:
        for number, (drive_v, temperature, prf_hz) in enumerate(points):
            station.progress(number / len(points), f"{drive_v:g} V, {temperature:g} degC")
            try:
                light = _light_at(station, drive_v, temperature, prf_hz)
            except InterlockTripped as stopped:
                if stopped.interlock != "warm-up" or temperature >= WORK_DEGC:
                    raise
                break  # the diode cannot be cooled further; it need not
            if light.trace_mv.max() < NO_LIGHT_MV or light.mean_power_mw <= 0:
                found = f"No light at {drive_v:g} V and {temperature:g} degC: lid closed, or the meters see nothing."
                return refused(NAME, found, REMEDY)
            pulses.append(measured(light, drive_v, temperature, prf_hz))
            currents.append(measured_current(light, prf_hz))
    finally:
        meters.close()
        if station.controller.state == "ready":
            station.controller.work_at(station.settings)
    outcome = _judged(station, pulses[: len(volts)], pulses[len(volts) :])
    return with_current(outcome, sorted((c for c in currents if c is not None), key=lambda c: c.prf_hz))


def _light_at(station: Station, drive_v: float, degc: float, prf_hz: float) -> Light:
    meters = station.meters
    if meters is None:
        raise BadInput("no light meters")
    changes = {
        "pulser": {"drive_v": drive_v, "prf_hz": prf_hz},
        "diode": {"target_degc": degc, "warm_up_limit_s": REACH_LIMIT_S},
    }
    controller = station.controller
    controller.work_at(override(station.settings, changes))
    controller.warm_up()
    where = f"{drive_v:g} V, {degc:g} degC, {prf_hz / 1e3:g} kHz"
    working = (drive_v, degc) == (WORK_V, WORK_DEGC)
    job = LightJob(meters, replace(SWEEP, prf_hz=prf_hz), where, station.clock, with_current=working)
    outcome = controller.scan(job, NoStore(station.folder))
    if outcome.stop_reason != "complete" or job.light is None:
        raise Interrupted(outcome.stop_reason)
    return job.light


def measured(light: Light, drive_v: float, degc: float, prf_hz: float) -> Pulse:
    """Evaluate one trace: width and rise time by interpolation between samples, power by the area under it."""
    times = light.times_ps
    trace = light.trace_mv - float(np.median(light.trace_mv))
    peak = int(np.argmax(trace))
    top = float(trace[peak])
    before, after = trace[: peak + 1], trace[peak:]
    start, end = peak - int(np.argmax(before[::-1] < 0.05 * top)), int(np.argmax(after < 0.5 * top))
    low, half, high = np.interp(np.array([0.1, 0.5, 0.9]) * top, trace[start : peak + 1], times[start : peak + 1])
    share = (after[end - 1] - 0.5 * top) / (after[end - 1] - after[end])
    fall_ps = times[peak + end - 1] + share * (times[1] - times[0])
    area_ps = float(trace.sum() * (times[1] - times[0]) / top)  # of a pulse with peak 1
    energy_nj = light.mean_power_mw / prf_hz * 1e6
    peak_w = energy_nj * 1e3 / area_ps / EXIT_TRANSMISSION
    fwhm_ps, rise_ps = float(fall_ps - half), float(high - low)
    return Pulse(drive_v, degc, peak_w, fwhm_ps, rise_ps, light.mean_power_mw, energy_nj)


def _judged(station: Station, by_volts: list[Pulse], by_degc: list[Pulse]) -> Outcome:
    cool = [p for p in by_volts if p.drive_v**2 * WORK_HZ <= HEAT_RESERVE * TRANSMITTER_HEAT.value]
    best = max(cool, key=lambda p: p.peak_w)
    highest_w = max(p.peak_w for p in by_degc)
    best_degc = min(p.degc for p in by_degc if p.peak_w >= (1 - METER_SHARE) * highest_w)  # a cooler diode lasts longer
    passed = best.peak_w >= MIN_PEAK_W and best.fwhm_ps <= LARGEST_FWHM_PS
    in_force = station.settings.pulser.drive_v, station.settings.diode.target_degc
    figures: dict[str, float | int | str | bool | None] = {
        "working_drive_v": best.drive_v,
        "working_degc": best_degc,
        "peak_power_w": best.peak_w,
        "fwhm_ps": best.fwhm_ps,
        "rise_time_ps": best.rise_ps,
        "pulse_energy_at_exit_nj": best.energy_nj,
        "mean_power_at_exit_mw_at_80_khz": best.energy_nj * WORK_HZ * 1e-6,
        "drive_v_in_force": in_force[0],
        "degc_in_force": in_force[1],
    }
    coldest = min(p.degc for p in by_degc)
    figures["coldest_degc"] = coldest
    advice = "Let diode and pulser be checked: the pulse is weak or long."
    same = in_force == (best.drive_v, best_degc)
    change = f"Set pulser.drive_v to {best.drive_v:g} and diode.target_degc to {best_degc:g}."
    return Outcome(
        NAME,
        passed,
        [
            f"Working point within the limits at {WORK_HZ / 1e3:g} kHz: {best.drive_v:g} V and {best_degc:g} degC; "
            f"there the pulse has {best.peak_w:.0f} W, {best.fwhm_ps:.0f} ps FWHM and {best.rise_ps:.0f} ps rise time "
            "(dissertation: 290 V, 23 degC, 128.2 W, 44 ps, 32 ps).",
            f"At {WORK_HZ / 1e3:g} kHz the mean power at the exit is {best.energy_nj * WORK_HZ * 1e-6:.2f} mW.",
            f"The diode was taken from {max(p.degc for p in by_degc):g} down to {coldest:g} degC"
            + ("." if coldest <= MIN_DEGC else f"; here it cannot be cooled to {MIN_DEGC:g} degC."),
        ],
        ("Nothing to do." if same else change) if passed else advice,
        (
            f"{best.peak_w:.0f} W",
            f"peak power at {best.drive_v:g} V and {best_degc:g} degC (at least {MIN_PEAK_W:g} W)",
        ),
        figures,
        [
            Plot("voltage", "Pulse against supply voltage", _VOLTS, lambda f: _draw_volts(f, by_volts, best.drive_v)),
            Plot("temperature", "Pulse against temperature", _DEGC, lambda f: _draw_degc(f, by_degc, best_degc)),
        ],
        {"voltage": _readings(by_volts), "temperature": _readings(by_degc)},
    )


def with_current(outcome: Outcome, found: list[Current]) -> Outcome:
    """Add the current pulses to what was found of the light; they decide nothing."""
    plot = Plot("current", "Current pulse", _CURRENT, lambda figure: draw_current(figure, found))
    return replace(
        outcome,
        findings=[*outcome.findings, current_finding(found)],
        figures={**outcome.figures, **current_figures(found)},
        plots=[*outcome.plots, *([plot] if found else [])],
    )


_CURRENT = "Voltage across R_M over its resistance, at 290 V and 23 degC, as in figure 2.7."
_VOLTS = (
    "Peak power, width and rise time at 23 degC, 20 kHz, as in figures 2.8 to 2.10; shaded: overheats at 80 kHz; "
    "dashed: the working point found."
)
_DEGC = "Peak power, width and rise time at 290 V and 80 kHz, as in figures 2.11 and 2.12; dashed: the one found."


def _readings(pulses: list[Pulse]) -> Readings:
    return Readings(Pulse._fields, np.array(pulses))


def _draw_volts(figure: Figure, pulses: list[Pulse], found_v: float) -> None:
    axes_of = figure.subplots(1, 3)
    volts = [p.drive_v for p in pulses]
    limit_v = max_drive_v(WORK_HZ)
    for axes, label, values in (
        (axes_of[0], "peak power, W", [p.peak_w for p in pulses]),
        (axes_of[1], "FWHM, ps", [p.fwhm_ps for p in pulses]),
        (axes_of[2], "rise time, ps", [p.rise_ps for p in pulses]),
    ):
        axes.plot(volts, values, "o-", ms=4)
        axes.axvspan(limit_v, max(volts), color="0.9")
        axes.axvline(found_v, color="0.4", ls="--", lw=1)
        axes.set(xlabel="supply voltage, V", ylabel=label)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)


def _draw_degc(figure: Figure, pulses: list[Pulse], found_degc: float) -> None:
    left, right = figure.subplots(1, 2)
    degc = [p.degc for p in pulses]
    left.plot(degc, [p.peak_w for p in pulses], "o-", ms=4)
    left.set(xlabel="temperature, degC", ylabel="peak power, W", ylim=(0, None))
    right.plot(degc, [p.fwhm_ps for p in pulses], "o-", ms=4, label="FWHM")
    right.plot(degc, [p.rise_ps for p in pulses], "o-", ms=4, label="rise time")
    right.set(xlabel="temperature, degC", ylabel="FWHM and rise time, ps", ylim=(0, None))
    right.legend(frameon=False)
    for axes in (left, right):
        axes.axvline(found_degc, color="0.4", ls="--", lw=1)
        axes.grid(alpha=0.3)
