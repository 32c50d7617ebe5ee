"""The check of the range zero on the command line: what a scan is checked by, and what its check found."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from picoradar.drivers.errors import LimitError
from picoradar.instrument.acquisition import PLATE, MarkPlan, RasterPlan, Setup, zero_check_of
from picoradar.instrument.calibration import Calibration, ZeroCheck
from picoradar.instrument.cli import output
from picoradar.instrument.events import JsonObject
from picoradar.instrument.files.points import PointFile, is_recording
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Settings

if TYPE_CHECKING:
    from picoradar.registration import Objection

__all__ = [
    "PLATE",
    "check_of",
    "check_of_points",
    "described",
    "mark_for",
    "objections",
    "objections_so_far",
    "plate_now",
    "zero_check_of",
]

NOT_SAID = (
    "Whether the range zero of these points was checked, {file} does not say. An error of it leaves no trace in the "
    "residuals. Export the recording with picoradar export, or register the recording itself."
)


def mark_for(setup: Setup) -> MarkPlan | None:
    """Plan the mark that a scan is checked by; None where there is none, and said where it cannot be reached."""
    try:
        mark = MarkPlan.of(setup.settings, setup.calibration)
    except LimitError as error:
        _say(f"no check of the range zero: the mark of the calibration cannot be reached ({error})")
        return None
    if mark is None and setup.calibration.zero_plate is None:
        _say("no mark to check the range zero by (zero_mark of the calibration); see docs/zero-check.md")
    elif mark is not None and mark.stands_in(RasterPlan.of(setup.settings, setup.calibration)):
        _say("the mark of the range zero stands in the raster: points in its corner are of the mark, not of the target")
    return mark


def plate_now(settings: Settings, calibration: Calibration) -> JsonObject | None:
    """Get the check on a plate that a scan without a mark relies on, with its age in hours; None where there is one."""
    plate = calibration.zero_plate
    if plate is None or (calibration.zero_mark is not None and settings.scanner.zero_mark):
        return None
    age_h = (datetime.datetime.now(datetime.UTC) - plate.date).total_seconds() / 3600
    if not age_h <= settings.scanner.zero_hours:
        hours = f"{settings.scanner.zero_hours:g} h (scanner.zero_hours)"
        _say(f"the check of the range zero is {age_h:.1f} h old and holds for {hours}: run picoradar bench zero")
    return {"plate": plate.model_dump(mode="json"), "age_h": age_h}


def check_of(path: Path) -> ZeroCheck:
    """Judge the check of a recording."""
    with Recording.open(path) as recording:
        return zero_check_of(recording)


def check_of_points(cloud: Path, points: PointFile) -> ZeroCheck | None:
    """Judge the check of a recording, or take what a point file says of it.

    None where there was no radar: points of another program, which say nothing of a range error.
    """
    if is_recording(cloud):
        return check_of(cloud)
    if points.about.zero_check is not None:
        return ZeroCheck(**points.about.zero_check)
    return None if points.about.range_error is None else ZeroCheck("none", NOT_SAID.format(file=cloud.name))


def described(check: ZeroCheck | None) -> JsonObject | None:
    """Return a check as plain data, None where there was no radar."""
    return None if check is None else check.to_dict()


def objections(check: ZeroCheck | None) -> list[Objection]:
    """Return what a check says against a registration: nothing when it has passed, or when there was no radar."""
    from picoradar.registration import Objection

    return [] if check is None or check.passed else [Objection(check.sentence, fails=check.outcome == "failed")]


def objections_so_far(recording: Recording) -> list[Objection]:
    """Return the same while the scan is made: the reading after its last line is not missing yet."""
    check = zero_check_of(recording)
    return [] if check.outcome == "none" and recording.zero_readings() else objections(check)


def _say(text: str) -> None:
    output.console().print(text, markup=False)
