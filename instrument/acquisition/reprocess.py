"""`reprocess`: a recording ranged from its raw traces or windows by another estimator or another calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from picoradar.instrument.acquisition.line import reprocessed
from picoradar.instrument.acquisition.order import LineOrder
from picoradar.instrument.acquisition.row import Row, TakenRows
from picoradar.instrument.acquisition.window_ranging import range_line
from picoradar.instrument.acquisition.zero_check import PLATE, plate_age_h
from picoradar.instrument.calibration import Calibration, Method, Ranging
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.ranging import LineBefore, Ranges, estimate, mark_footprint
from picoradar.instrument.recording import Recording


def reprocess(
    source: Path,
    target: Path,
    *,
    method: Method | None = None,
    calibration: Calibration | None = None,
    material: str | None = None,
    on_line: Callable[[ScanLine], None] | None = None,
) -> None:
    """Write a new recording with the traces of an old one and new ranges.

    Parameters
    ----------
    source, target : Path
        Recording with raw traces or windows; recording to make.
    method : {"half-maximum", "template"}, optional
        Estimator; the recording's own by default.
    calibration : Calibration, optional
        The recording's own by default.
    material : str, optional
        What was scanned; what the recording says by default. Its bias in the calibration is taken off.
    on_line : callable, optional
        Called with each line done.

    Raises
    ------
    BadInput
        When the recording holds no raw samples, windows are to be ranged by another estimator than ``template``, or
        the calibration lacks what the estimator needs.
    RecordingError
        When the source is damaged or the target exists.
    """
    with Recording.open(source) as old:
        used = calibration or _own_calibration(old)
        estimator = method or old.header.get("raster", {}).get("estimator", "half-maximum")
        target_of = (old.header.get("range_error") or {}).get("material", "") if material is None else material
        ranging: Ranging = "window" if old.raster.get("mode") == "window" else estimator
        header = _header(old.header, source, used, estimator)
        header["range_error"] = used.range_error(target_of, ranging)._asdict()
        header.pop("stretch", None)
        if (stretch := used.stretch_terms(target_of, ranging)) is not None:
            header["stretch"] = stretch
        header["settings"] = _of_material(old.header.get("settings"), target_of)
        used = used.for_material(target_of, ranging)
        if PLATE in header:
            header[PLATE] = {**header[PLATE], "age_h": plate_age_h(old)}
        with Recording.create(target, header) as new:
            taken = TakenRows(LineOrder(old.raster["rows"], old.raster.get("order", "rows")))
            for row in taken.order.sorted(old.done):
                beside = taken.beside(row)
                before = None if beside is None else beside.ranges
                ranged = _range_line(old, old.line(row), before, estimator, used)
                taken.add(Row(row, LineBefore(ranged.range_mm, ranged.range_variance_mm2)))
                new.append(ranged)
                if on_line is not None:
                    on_line(ranged)
            for reading in old.zero_readings():
                new.append_zero(reading)
            new.finish(
                f"reprocessed from {source.name} ({old.stop_reason})",
                laser_off_verified=bool(old.laser_off_verified),
            )


def _range_line(
    recording: Recording, line: ScanLine, before: LineBefore | None, method: Method, calibration: Calibration
) -> ScanLine:
    ranges = _ranges_of(recording, line, method, calibration)
    if (step_mm := recording.raster.get("step_mm")) is not None:  # else it is no raster
        ranges = mark_footprint(ranges, step_mm, before)
    # Whether the target moved is known from revisits of one point, which are not in the line.
    flags = ranges.flags | (line.flags & np.uint16(Flag.MOTION))
    return reprocessed(line, replace(ranges, flags=flags), calibration)


def _ranges_of(recording: Recording, line: ScanLine, method: Method, calibration: Calibration) -> Ranges:
    if line.windows is not None:
        if method != "template":
            raise BadInput(
                f"{recording.path}: was scanned in windows, which show the edges of the pulses alone; "
                f"{method} needs whole traces, use template"
            )
        return range_line(line.columns, line.windows, calibration)
    if line.traces is None:
        raise BadInput(
            f"{recording.path}: line {line.index} has no raw samples; only scans that keep them can be reprocessed"
        )
    return estimate(
        line.traces.mv,
        line.traces.times_ps,
        method=method,
        calibration=calibration,
        sweeps=line.sweeps,
        clipped=(line.flags & np.uint16(Flag.CLIPPED)) != 0,
    )


def _own_calibration(recording: Recording) -> Calibration:
    content = recording.header.get("calibration")
    if not isinstance(content, dict):
        raise BadInput(f"{recording.path}: holds no calibration; give one with --calibration")
    return Calibration.model_validate(content)


def _header(old: JsonObject, source: Path, calibration: Calibration, method: Method) -> JsonObject:
    kept = {key: value for key, value in old.items() if key not in ("versions", "calibration_digest")}
    return {
        **kept,
        "raster": {**old["raster"], "estimator": method},
        "calibration": calibration.content(),
        "calibration_digest": calibration.digest,
        "ranged_from": {"recording": source.name, "versions": old.get("versions")},
    }


def _of_material(settings: JsonObject | None, material: str) -> JsonObject | None:
    """Return the settings with what was scanned, so that a scan that is gone on with is ranged as its lines so far."""
    scan = None if settings is None else settings.get("scan")
    return {**(settings or {}), "scan": {**scan, "material": material}} if isinstance(scan, dict) else settings
