"""`zero_check_of`: whether a recording's range zero was checked, under the calibration that its ranges are of.

The raw readings are ranged anew each time, so that another calibration is judged by the same measurement.
"""

from __future__ import annotations

import json
import math

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.errors import DECODER_ERRORS
from picoradar.instrument.acquisition.window_ranging import range_windows
from picoradar.instrument.calibration import (
    Calibration,
    Method,
    ZeroCheck,
    ZeroDifference,
    ZeroLimits,
    ZeroMark,
    ZeroPlate,
    judge_zero,
    true_angles,
)
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import NO_RANGE, Flag, ZeroReading
from picoradar.instrument.ranging import Ranges, estimate
from picoradar.instrument.recording import Recording, RecordingError

NOT_OF_ONE_PLATE = np.uint16(NO_RANGE | Flag.MIXED | Flag.CLIPPED | Flag.OVERLAPPED)
PLATE = "zero_plate"
"""Key of the header, and kind of an event, with how old the check on a plate was."""
NONE = (
    "The range zero of this scan was not checked: {why}. An error of it leaves no trace in the residuals. Fit a mark "
    "and name it in the calibration (zero_mark), or run picoradar bench zero on a plate and scan with the calibration "
    "that it makes (docs/zero-check.md)."
)


def zero_check_of(recording: Recording, limits: ZeroLimits | None = None) -> ZeroCheck:
    """Judge the check of the range zero of a recording, under the calibration in its header.

    Parameters
    ----------
    recording : Recording
    limits : ZeroLimits, optional

    Returns
    -------
    ZeroCheck
        Of the mark if it was measured, else of the plate of ``bench zero``. ``none`` also where a reading is damaged,
        or a scan was not checked at its beginning or after its last line.
    """
    try:
        calibration = _calibration(recording)
        method: Method = recording.raster.get("estimator", "half-maximum")
        if readings := recording.zero_readings():
            found = [_difference(reading, method, calibration, limits or ZeroLimits()) for reading in readings]
            return _whole(judge_zero(found, "mark", limits), readings, recording)
        if PLATE in recording.header:
            return _of_plate(recording, method, calibration, limits)
    except (RecordingError, BadInput) as error:
        return ZeroCheck("none", NONE.format(why=error))
    except DECODER_ERRORS as error:  # a header that somebody has written
        return ZeroCheck("none", NONE.format(why=f"what the recording says of it cannot be used ({error})"))
    return ZeroCheck("none", NONE.format(why="there was neither a mark nor a plate"))


def plate_age_h(recording: Recording) -> float:
    """Get how old (hours) the check on a plate was when the scan was begun, or at the latest gone on with.

    Raises
    ------
    RecordingError, LookupError, TypeError
        When the recording does not say.
    """
    later = [event.fields["age_h"] for event in recording.events() if event.kind == PLATE]
    return max(float(age_h) for age_h in (recording.header[PLATE]["age_h"], *later))


def plate_range(plate: ZeroPlate, method: Method, calibration: Calibration) -> tuple[float, float, float]:
    """Return what a plate reads under a calibration: range, its noise, and the deviation of the walk there, mm.

    Raises
    ------
    LookupError
        When it was not measured by this estimator.
    """
    seen = plate.measured[method]
    range_mm, walk_sd_mm = calibration.range_zero_mm + seen.interval_mm, 0.0
    if walk := calibration.walk.get(method):
        correction = walk.at(np.array([seen.response_mv]))
        range_mm, walk_sd_mm = range_mm - float(correction.error_mm[0]), float(correction.sd_mm[0])
    return range_mm, seen.sd_mm, walk_sd_mm


def zero_sd_mm(calibration: Calibration) -> float:
    """Get the standard deviation of the range zero itself, as far as the calibration knows it."""
    if calibration.range_zero_sd_mm is not None:
        return calibration.range_zero_sd_mm
    return calibration.geometry.sd.get("range_zero_mm", 0.0) if calibration.geometry else 0.0


def _calibration(recording: Recording) -> Calibration:
    content = recording.header.get("calibration")
    if not isinstance(content, dict):
        raise BadInput("the recording holds no calibration")
    return Calibration.from_json(json.dumps(content), str(recording.path))


def _difference(reading: ZeroReading, method: Method, calibration: Calibration, limits: ZeroLimits) -> ZeroDifference:
    """Range the records of the mark, and compare their mean with its known range."""
    known_mm, known_sd_mm = _known(reading, calibration, limits)
    when = f"after {reading.lines} lines" if reading.lines else "before the first line"
    found = _ranges(reading, method, calibration)
    good = (found.flags & NOT_OF_ONE_PLATE) == 0
    if not good.all():
        return ZeroDifference(when, math.nan, math.nan, math.nan)
    noise_mm = math.sqrt(float(found.variance_mm2.mean()) / len(good))
    common_mm = math.hypot(known_sd_mm, zero_sd_mm(calibration), float(found.bias_sd_mm.mean()))
    return ZeroDifference(when, float(found.range_mm.mean()) - known_mm, noise_mm, common_mm)


def _ranges(reading: ZeroReading, method: Method, calibration: Calibration) -> Ranges:
    if reading.windows is not None:
        return range_windows(reading.windows, calibration)
    if reading.traces is None:
        raise BadInput("a reading of the mark has no raw records")
    traces = reading.traces
    return estimate(
        traces.mv,
        traces.times_ps,
        method=method,
        calibration=calibration,
        sweeps=traces.sweeps,
        clipped=reading.clipped,
    )


def _known(reading: ZeroReading, calibration: Calibration, limits: ZeroLimits) -> tuple[float, float]:
    """Return range and deviation of the mark: of the calibration if it has this one, else as they were recorded."""
    mark = calibration.zero_mark
    if mark is not None and _is_at(mark, true_angles(reading.angles_rad, calibration.scanner), limits):
        return mark.range_mm, mark.sd_mm
    return reading.mark_mm, reading.mark_sd_mm


def _is_at(mark: ZeroMark, angles_rad: NDArray[np.float64], limits: ZeroLimits) -> bool:
    away_deg = np.degrees(angles_rad) - (mark.x_deg, mark.y_deg)
    return bool(np.abs(away_deg).max() < limits.same_place_deg)


def _whole(check: ZeroCheck, readings: list[ZeroReading], recording: Recording) -> ZeroCheck:
    """Return a check as it is if it covers the scan from its first line to its last."""
    if check.outcome != "passed":
        return check
    if readings[0].lines != 0:
        return ZeroCheck("none", NONE.format(why="not before its first line"), "mark")
    if (readings[-1].lines or 0) < len(recording.done):
        why = "not after its last line (resume the scan, or scan again)"
        return ZeroCheck("none", NONE.format(why=why), "mark")
    return check


def _of_plate(recording: Recording, method: Method, calibration: Calibration, limits: ZeroLimits | None) -> ZeroCheck:
    plate = ZeroPlate.model_validate_json(json.dumps(recording.header[PLATE]["plate"]))
    age_h, hours = plate_age_h(recording), float(recording.header["settings"]["scanner"]["zero_hours"])
    if not 0 <= age_h <= hours:
        why = f"the check on a plate was {age_h:.1f} h old, and holds for {hours:g} h (scanner.zero_hours)"
        return ZeroCheck("none", NONE.format(why=why), "plate")
    range_mm, noise_mm, walk_sd_mm = plate_range(plate, method, calibration)
    common_mm = math.hypot(plate.sd_mm, zero_sd_mm(calibration), walk_sd_mm)
    return judge_zero(
        [ZeroDifference(f"{age_h:.1f} h before the scan", range_mm - plate.distance_mm, noise_mm, common_mm)],
        "plate",
        limits,
    )
