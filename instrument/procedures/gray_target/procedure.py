"""`gray-target`: timing walk, range zero, pulse shapes and noise from cards of many gray levels (figures 2.14, 2.15).

Cards between white and nearly black stand in turn at a known distance. Every second one calibrates, the ones between
are held back and judge the calibration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from picoradar.instrument.calibration import METHODS, Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.procedures.gray_target.level import FloatArray, Level
from picoradar.instrument.procedures.gray_target.report import judged
from picoradar.instrument.procedures.station.certainty import STAGE_SD_MM, zero_sd_mm
from picoradar.instrument.procedures.station.findings import lost_readings, refused
from picoradar.instrument.procedures.station.outcome import Outcome
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Station
from picoradar.instrument.ranging import estimate, fit_walk, learn

NAME = "gray-target"
WALK_FREE_MV = 40.0  # the range zero is taken above: there the walk is flat (figure 2.15)
WHITE, DARKEST = 0.9, 0.083  # reflectances
DISTANCE_MM = 800.0  # white gives 100 mV there, a tenth below the end of the A/D: all that a scan can meet is covered
MIN_SPAN = 2.5  # brightest over darkest response: less is no gray wedge
REFERENCE_ROOM_PS = 400.0  # rate, voltage and temperature move it by some 200 ps
REMEDY = "Put gray cards between white and black at the stated distance, square to the beam, and run this again."


def run(station: Station, *, distance_mm: float = DISTANCE_MM, levels: int = 12, readings: int = 200) -> Outcome:
    """Measure the cards, fit the calibration, and judge it on the cards held back.

    Parameters
    ----------
    station : Station
    distance_mm : float
        Where the cards stand.
    levels : int
        Cards that calibrate; one card less, between them, is held back.
    readings : int
        Readings a card.
    """
    measured: list[Level] = []
    grays = wedge(WHITE, DARKEST, 2 * levels - 1)
    for number, gray in enumerate(grays):
        station.progress(number / len(grays), f"card {number + 1} of {len(grays)}")
        level = measure(station, f"card-{number + 1:02d}", distance_mm, float(gray), readings)
        if lost := _lost(level, station.calibration):
            return refused(NAME, lost, REMEDY)
        measured.append(level)
    if wrong := no_wedge(measured, station.calibration):
        return refused(NAME, wrong, REMEDY)
    station.progress(1.0, "fitting")
    how = f"bench procedure {NAME}: {levels} cards x {readings} readings at {distance_mm:g} mm, {station.stage}"
    calibration = station.stamped(calibrate(measured[0::2], station.calibration), how)
    return judged(NAME, measured, calibration, REMEDY)


def wedge(white: float, darkest: float, cards: int) -> FloatArray:
    """Return the reflectances (cards,) of a wedge, the closer together the darker: there the walk is steep."""
    return np.asarray(np.linspace(white**-0.5, darkest**-0.5, cards) ** -2.0)


def measure(station: Station, name: str, distance_mm: float, gray: float, readings: int) -> Level:
    """Put one card up and take its readings."""
    true_mm = station.stage.place(Placing("card", distance_mm, gray=gray))
    return Level(gray, true_mm, station.dwell(name, readings).trace)


def calibrate(levels: Sequence[Level], before: Calibration) -> Calibration:
    """Fit range zero, walk of both estimators, pulse shapes, noise and place of the reference; the rest stays.

    Raises
    ------
    BadInput
        When no card is bright enough for the range zero, or the cards are too few or too much alike.
    """
    times, sweeps = levels[0].trace.times_ps, levels[0].trace.sweeps
    templates, noise = learn([level.traces_mv for level in levels], times, sweeps=sweeps)
    bare = _bare(before).model_copy(update={"range_zero_mm": 0.0, "templates": templates, "noise": noise})
    errors = {method: [level.ranges(method, bare) for level in levels] for method in METHODS}
    bright = [error for response, error in errors["template"] if np.median(response) > WALK_FREE_MV]
    if not bright:
        raise BadInput(f"no card gives more than {WALK_FREE_MV:g} mV; use a whiter one, or stand it nearer")
    zero_errors = np.concatenate(bright)
    zero_mm = -float(np.mean(zero_errors))
    readings_sd_mm = float(np.std(zero_errors)) / len(zero_errors) ** 0.5
    shifted = {m: [(response, error + zero_mm) for response, error in errors[m]] for m in METHODS}
    reference = estimate(levels[0].traces_mv, times, calibration=bare, sweeps=sweeps).reference_ps
    middle_ps = float(np.nanmedian(reference))
    return bare.model_copy(
        update={
            "range_zero_mm": zero_mm,
            "range_zero_sd_mm": zero_sd_mm(math.hypot(readings_sd_mm, STAGE_SD_MM)),
            "geometry": before.geometry.without("range_zero_mm") if before.geometry else None,
            "walk": {method: fit_walk(shifted[method]) for method in METHODS},
            "reference_ps": (middle_ps - REFERENCE_ROOM_PS, middle_ps + REFERENCE_ROOM_PS),
        }
    )


def _bare(calibration: Calibration) -> Calibration:
    """Return a calibration that finds the pulses wherever they are and corrects nothing."""
    return calibration.model_copy(update={"walk": {}, "reference_ps": None})


def _lost(level: Level, calibration: Calibration) -> str:
    found = len(level.ranges("half-maximum", _bare(calibration))[0])
    return lost_readings(found, len(level.traces_mv), f"the card of reflectance {level.gray:.2f}")


def no_wedge(levels: Sequence[Level], calibration: Calibration) -> str:
    """Say in words why these readings cannot be those of gray cards; empty when they can."""
    bare = _bare(calibration)
    means: FloatArray = np.array([np.median(level.ranges("half-maximum", bare)[0]) for level in levels])
    span = float(means.max() / means.min())
    if span < MIN_SPAN:
        return f"The responses differ by a factor of {span:.2f} only: this is no series of gray cards (a plain plate?)."
    if np.any(np.diff(means) > 0.05 * means[:-1]):
        return "The responses do not fall from card to card: the cards stand in another order than asked for."
    return ""
