"""`zero`: the range zero checked on a plate at a known distance, for a radar that has no mark in its field."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.acquisition import plate_range, zero_sd_mm
from picoradar.instrument.calibration import (
    METHODS,
    Calibration,
    Method,
    ZeroCheck,
    ZeroDifference,
    ZeroInterval,
    ZeroPlate,
    judge_zero,
)
from picoradar.instrument.procedures.station.findings import lost_readings, refused
from picoradar.instrument.procedures.station.measured import Measured
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Station

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

NAME = "zero"
DISTANCE_MM = 800.0  # where gray-target calibrates the range zero
SD_MM = 0.2  # of a distance read by eye from a steel rule
GRAY_AT_1_M = 0.7  # reflectance that gives about 50 mV at 1 m
REMEDY = (
    "Put a matt plate square to the beam at a distance that you know, and run this again. If it fails again, the range "
    "zero has moved: run gray-target."
)


def run(station: Station, *, distance_mm: float = DISTANCE_MM, sd_mm: float = SD_MM, readings: int = 200) -> Outcome:
    """Measure the plate, and compare with where it stands.

    Parameters
    ----------
    station : Station
    distance_mm : float
        Where the plate is asked to stand; what counts is the distance that the stage reports.
    sd_mm : float
        Standard deviation of that distance, above 0.
    readings : int
    """
    station.progress(0.0, f"plate at {distance_mm:g} mm")
    gray = min(0.9, round(GRAY_AT_1_M * (distance_mm / 1000) ** 2, 2))
    known_mm = station.stage.place(Placing("plate", distance_mm, gray=gray))
    measured = station.dwell("plate", readings)
    station.progress(1.0, "judging")
    calibration = station.calibration
    methods = [method for method in METHODS if method != "template" or calibration.templates is not None]
    seen = {method: measured.ranges(method, calibration).range_mm for method in methods}
    for range_mm in seen.values():
        if lost := lost_readings(int(np.isfinite(range_mm).sum()), readings, f"the plate at {known_mm:g} mm"):
            return refused(NAME, lost, REMEDY)
    intervals = {method: _interval(measured, method, calibration) for method in methods}
    plate = ZeroPlate(date=station.date, distance_mm=known_mm, sd_mm=sd_mm, measured=intervals)
    return _outcome(station, plate, seen)


def _interval(measured: Measured, method: Method, calibration: Calibration) -> ZeroInterval:
    """Return the mean of the readings before range zero and walk are applied."""
    found = measured.ranges(method, calibration.model_copy(update={"range_zero_mm": 0.0, "walk": {}}))
    good = np.isfinite(found.range_mm)
    interval_mm = found.range_mm[good]
    return ZeroInterval(
        interval_mm=float(interval_mm.mean()),
        sd_mm=float(interval_mm.std(ddof=1) / math.sqrt(len(interval_mm))),
        response_mv=float(found.response_mv[good].mean()),
    )


def _judged(plate: ZeroPlate, method: Method, calibration: Calibration) -> ZeroCheck:
    range_mm, noise_mm, walk_sd_mm = plate_range(plate, method, calibration)
    common_mm = math.hypot(plate.sd_mm, zero_sd_mm(calibration), walk_sd_mm)
    return judge_zero([ZeroDifference("now", range_mm - plate.distance_mm, noise_mm, common_mm)], "plate")


def _outcome(station: Station, plate: ZeroPlate, seen: dict[Method, FloatArray]) -> Outcome:
    checks = {method: _judged(plate, method, station.calibration) for method in seen}
    passed = all(check.passed for check in checks.values())
    figures: dict[str, float | int | str | bool | None] = {
        "distance_mm": plate.distance_mm,
        "distance_sd_mm": plate.sd_mm,
    }
    for method, check in checks.items():
        figures[f"{method.replace('-', '_')}_difference_mm"] = check.largest_mm
        figures[f"{method.replace('-', '_')}_limit_mm"] = check.limit_mm
    hours = f"{station.settings.scanner.zero_hours:g} h (scanner.zero_hours)"
    off_mm = checks[station.best_method].largest_mm
    # A copy would not be checked. Its date stays that of the calibration: nothing was calibrated.
    checked = Calibration.model_validate({**station.calibration.model_dump(), "zero_plate": plate.model_dump()})
    return Outcome(
        NAME,
        passed,
        [f"By the {method} estimator: {check.sentence}" for method, check in checks.items()],
        f"Scan with the calibration beside this page: for {hours} its scans count as checked." if passed else REMEDY,
        ("not found" if off_mm is None else f"{off_mm:+.2f} mm", "measured less known distance of the plate"),
        figures,
        [Plot("plate", "Readings of the plate", _SEEN, lambda figure: _draw(figure, plate, seen))],
        {"plate": Readings(tuple(f"{m.replace('-', '_')}_mm" for m in seen), np.column_stack([*seen.values()]))},
        checked if passed else None,
    )


_SEEN = "Each reading by each estimator. Shaded: where the plate stands, to three standard deviations of its distance."


def _draw(figure: Figure, plate: ZeroPlate, seen: dict[Method, FloatArray]) -> None:
    axes = figure.subplots()
    for method, range_mm in seen.items():
        axes.plot(range_mm - plate.distance_mm, lw=0.6, label=f"{method}: mean {np.nanmean(range_mm):.2f} mm")
    axes.axhspan(-3 * plate.sd_mm, 3 * plate.sd_mm, color="0.85")
    axes.set(xlabel="reading", ylabel="measured less known distance, mm")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
