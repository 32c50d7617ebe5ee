"""`scanner`: commanded against true place of the beam on a scale, at 1 mm steps and after a fly-back (section 2.6.2).

The spot is read on a scale, for example by a camera that sees a pilot beam; the radar's laser stays off. A person
reads the places, but not the settling, which is over in milliseconds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import (
    angles_and_range,
    angles_to_codes,
    asked_angles,
    codes_to_angles,
    points_from,
    true_angles,
)
from picoradar.instrument.controller import make_safe
from picoradar.instrument.procedures.scanner.pictures import (
    FLYBACK_LIMIT_MM,
    FLYBACK_MM,
    LAG_MM,
    PLACES,
    SETTLING,
    STEP_LIMIT_MM,
    STEP_MM,
    WAITS_MS,
    draw_positions,
    draw_settling,
)
from picoradar.instrument.procedures.station.findings import refused
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Station

FloatArray = NDArray[np.float64]

NAME = "scanner"
RESTED_MS = 100.0
SURE = 2.5  # standard errors beyond which a lag is none of chance
RIGHT_SCALE_MM = 10.0
RIGHT_SCALE_SHARE = 0.05
REMEDY = "Put the millimetre scale square to the beam at the stated distance, zero on the beam at rest; run this again."


def run(station: Station, *, distance_mm: float = 1000.0, steps: int = 40, repeats: int = 20) -> Outcome:
    """Read the scale after steps, choose settling times, and compare with the places asked for.

    Parameters
    ----------
    station : Station
    distance_mm : float
        Of the scale.
    steps : int
        1 mm steps across the scale.
    repeats : int
        Readings at each waiting time.
    """
    reported_mm = station.stage.place(Placing("scale", distance_mm))
    beam = _Beam(station, reported_mm)
    try:
        along = _walk(station, beam, steps)
        if not np.isfinite(along).all():
            return refused(
                NAME, "The beam does not meet the scale: it stands outside the scan or out of range.", REMEDY
            )
        factor = float(np.polyfit(along[:, 0], along[:, 1], 1)[0])
        if abs(factor - 1.0) > RIGHT_SCALE_SHARE or np.abs(along[:, 1] - along[:, 0]).max() > RIGHT_SCALE_MM:
            found = (
                f"The scale does not follow the beam, which goes {factor:.2f} times as far as asked on it: it stands "
                "elsewhere, or the mirrors stick."
            )
            return refused(NAME, found, REMEDY)
        ways = (("step", STEP_MM), ("flyback", FLYBACK_MM)) if station.stage.reads_at_once else ()
        lags = {name: _lags(station, beam, mm, repeats) for name, mm in ways}
    finally:
        make_safe(station.controller.bench)
    return _judged(station, along, lags)


class _Beam:
    """Sends the beam to a place on the scale and tells where on it the beam should be by the calibration."""

    def __init__(self, station: Station, distance_mm: float) -> None:
        self._station = station
        self._distance_mm = distance_mm
        self._field_deg = station.settings.scanner.field_deg

    def to(self, x_mm: float, wait_ms: float) -> tuple[float, float]:
        """Return where the beam should be (of the quantised code) and where the scale shows it, x in mm."""
        calibration = self._station.calibration
        place = np.array([[x_mm, 0.0, self._distance_mm]])
        angles, ranges = angles_and_range(place, calibration.mirror_separation_mm)
        codes = angles_to_codes(asked_angles(angles, calibration.scanner), self._field_deg)
        self._station.controller.rest()
        self._station.controller.bench.galvo.move(int(codes[0, 0]), int(codes[0, 1]))
        self._station.clock.sleep(wait_ms * 1e-3)
        seen = self._station.stage.read_scale()
        true = true_angles(codes_to_angles(codes, self._field_deg), calibration.scanner)
        return float(points_from(true, ranges, calibration.mirror_separation_mm)[0, 0]), seen[0]


def _walk(station: Station, beam: _Beam, steps: int) -> FloatArray:
    """Steps of 1 mm across the scale: asked and seen places (steps + 1, 2)."""
    wait_ms = station.settings.scanner.settle_ms
    half = steps / 2 * STEP_MM
    beam.to(-half - STEP_MM, RESTED_MS)
    places = []
    for number in range(steps + 1):
        station.progress(0.3 * number / steps, f"place {number + 1} of {steps + 1}")
        places.append(beam.to(-half + number * STEP_MM, wait_ms))
    return np.array(places)


def _lags(station: Station, beam: _Beam, step_mm: float, repeats: int) -> FloatArray:
    """Way (waits, repeats) still missing after a step of ``step_mm``, for each waiting time."""
    table = np.empty((len(WAITS_MS), repeats))
    for row, wait_ms in enumerate(WAITS_MS):
        station.progress(0.3 + 0.7 * row / len(WAITS_MS), f"{step_mm:g} mm steps, {wait_ms:g} ms")
        for column in range(repeats):
            beam.to(-step_mm / 2, RESTED_MS)
            asked, seen = beam.to(step_mm / 2, wait_ms)
            table[row, column] = asked - seen
    return table


def _settling(lags: FloatArray) -> float | None:
    """Return the least waiting time (ms) from which on the mean lag stays within what is allowed, noise counted."""
    rest = lags[-1].mean()
    error = lags.std(axis=1, ddof=1) / math.sqrt(lags.shape[1])
    late = np.flatnonzero(np.abs(lags.mean(axis=1) - rest) > LAG_MM + SURE * error)
    first = 0 if late.size == 0 else int(late[-1]) + 1
    return WAITS_MS[first] if first < len(WAITS_MS) else None


def _judged(station: Station, along: FloatArray, lags: dict[str, FloatArray]) -> Outcome:
    asked, seen = along.T
    error = seen - asked
    slope, offset = np.polyfit(asked, seen, 1)
    steps_error = float(np.abs(error - error.mean()).max())
    figures: dict[str, float | int | str | bool | None] = {
        "largest_error_at_1_mm_steps_mm": steps_error,
        "offset_mm": float(offset),
        "scale_error": float(slope - 1.0),
        "settle_ms_in_force": station.settings.scanner.settle_ms,
        "flyback_settle_ms_in_force": station.settings.scanner.flyback_settle_ms,
    }
    findings = [f"At 1 mm steps the beam is within {steps_error:.2f} mm of its place (dissertation: 0.1 mm at 1 m)."]
    if abs(slope - 1.0) > 0.003:
        findings.append(f"The angle's scale is {100 * (slope - 1):.1f} % off: run geometry.")
    passed = steps_error <= 1.5 * STEP_LIMIT_MM
    plots = [Plot("places", "Place of the beam at 1 mm steps", PLACES, lambda f: draw_positions(f, asked, error))]
    next_step = "Nothing to do." if passed else "Let the scanner's amplifier be tuned, then run this again."
    if lags:
        settling = _settled(station, lags)
        figures.update(settling.figures)
        findings += settling.findings
        if not settling.enough:
            next_step = settling.advice
        passed &= settling.enough
        caption = "Way still missing after a step"
        plots.append(Plot("settling", caption, SETTLING, lambda f: draw_settling(f, lags, station.settings.scanner)))
    else:
        figures.update(dict.fromkeys(("flyback_error_after_2_ms_mm", "settle_ms", "flyback_settle_ms")))
        findings.append("Settling was not measured: it takes milliseconds, and needs a camera instead of a person.")
    return Outcome(
        NAME,
        passed,
        findings,
        next_step,
        (f"{steps_error:.2f} mm", "largest error of the beam's place at 1 mm steps (at most 0.15 mm)"),
        figures,
        plots,
        {
            "places": Readings(("asked_mm", "seen_mm"), along),
            **{name: _table(table) for name, table in lags.items()},
        },
    )


class _Settling(NamedTuple):
    """What the waiting times tell: whether those in force are ``enough``, in figures and words."""

    enough: bool
    figures: dict[str, float | int | str | bool | None]
    findings: list[str]
    advice: str


def _settled(station: Station, lags: dict[str, FloatArray]) -> _Settling:
    scanner = station.settings.scanner
    at_2_ms = float(np.abs(lags["flyback"][WAITS_MS.index(2.0)]).max())
    step_ms, flyback_ms = _settling(lags["step"]), _settling(lags["flyback"])
    in_time = (
        step_ms is not None
        and flyback_ms is not None
        and step_ms <= scanner.settle_ms
        and flyback_ms <= scanner.flyback_settle_ms
    )
    return _Settling(
        enough=in_time and at_2_ms <= 1.5 * FLYBACK_LIMIT_MM,
        figures={"flyback_error_after_2_ms_mm": at_2_ms, "settle_ms": step_ms, "flyback_settle_ms": flyback_ms},
        findings=[
            f"2 ms after a fly-back of {FLYBACK_MM:g} mm it is {at_2_ms:.2f} mm off (dissertation: 0.5 mm).",
            f"Settled to {LAG_MM:g} mm after {_ms(step_ms)} within a line and {_ms(flyback_ms)} after a fly-back; "
            f"in force are {scanner.settle_ms:g} ms and {scanner.flyback_settle_ms:g} ms.",
        ],
        advice=f"Set scanner.settle_ms to {_ms(step_ms)} and scanner.flyback_settle_ms to {_ms(flyback_ms)}. "
        "Then run this again.",
    )


def _ms(value: float | None) -> str:
    return f"more than {WAITS_MS[-1]:g} ms" if value is None else f"{value:g} ms"


def _table(lags: FloatArray) -> Readings:
    columns = ("wait_ms", *(f"lag_{number + 1}_mm" for number in range(lags.shape[1])))
    return Readings(columns, np.column_stack([WAITS_MS, lags]))
