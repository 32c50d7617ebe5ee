"""Whether a calibration is still valid for the instrument, and how two calibrations differ."""

from __future__ import annotations

import datetime
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration.file import Calibration
from picoradar.instrument.calibration.geometry import points_from, true_angles
from picoradar.instrument.settings import METHODS, Method, Settings

LARGEST_AGE = datetime.timedelta(days=180)
LARGEST_CHANGE_K = 0.5  # of the diode; timing and pulse shape follow its temperature
FIELD_RAD = 0.07
AT_MM = 900.0


def out_of_date(
    calibration: Calibration,
    settings: Settings,
    serial_numbers: Mapping[str, str],
    now: datetime.datetime | None = None,
) -> list[str]:
    """List why a calibration is no longer valid for the instrument; empty when it is valid.

    Parameters
    ----------
    calibration : Calibration
    settings : Settings
        With the operating temperature of the diode.
    serial_numbers : mapping
        Device name to serial number, of the devices connected now.
    now : datetime, optional
        To check its age; None skips that (a simulated bench does not age).
    """
    reasons = []
    for device, number in calibration.serial_numbers.items():
        here = serial_numbers.get(device, "")
        if here and here != number:
            reasons.append(f"made with {device} s/n {number}, now s/n {here}: run gray-target and geometry")
    target = settings.diode.target_degc
    if calibration.diode_degc is not None and abs(calibration.diode_degc - target) > LARGEST_CHANGE_K:
        reasons.append(
            f"made at {calibration.diode_degc:g} degC, the diode's target is {target:g} degC: run gray-target"
        )
    if now is not None and now - calibration.date > LARGEST_AGE:
        reasons.append(f"{(now - calibration.date).days} days old: run gray-target")
    if settings.scan.estimator == "template" and calibration.templates is None:
        reasons.append("holds no pulse shapes for the template estimator: run gray-target")
    return reasons


def differences(before: Calibration, after: Calibration) -> dict[str, float | str | None]:
    """Return the differences between two calibrations: values, and the largest change of a range and of a point."""
    found: dict[str, float | str | None] = {
        "range_zero_mm": after.range_zero_mm - before.range_zero_mm,
        "mirror_separation_mm": after.mirror_separation_mm - before.mirror_separation_mm,
    }
    for name in type(after.scanner).model_fields:
        found[name] = getattr(after.scanner, name) - getattr(before.scanner, name)
    for method in METHODS:
        key = f"{method.replace('-', '_')}_range_largest_mm"
        found[key] = _largest_range_change(before, after, method)
    for material, entries in after.materials.items():
        for ranging, entry in entries.items():
            if (old := before.materials.get(material, {}).get(ranging)) is not None:
                found[f"{material}_{ranging.replace('-', '_')}_bias_mm"] = entry.bias_mm - old.bias_mm
    found["point_largest_mm"] = _largest_point_change(before, after)
    found["instrument"] = "another" if _another(before, after) else "the same"
    found["days"] = (after.date - before.date).total_seconds() / 86400
    found["same"] = "yes" if before.digest == after.digest else "no"
    return found


def _another(before: Calibration, after: Calibration) -> bool:
    """Get whether a device that both calibrations name has changed."""
    return any(after.serial_numbers.get(name, number) != number for name, number in before.serial_numbers.items())


def _largest_range_change(before: Calibration, after: Calibration, method: Method) -> float | None:
    """Largest change of a range over the responses that both calibrations cover; None when there are none."""
    old, new = (one.walk.get(method) for one in (before, after))
    if old is None or new is None:
        return None
    low, high = max(old.valid_mv[0], new.valid_mv[0]), min(old.valid_mv[1], new.valid_mv[1])
    if low >= high:
        return None
    at: NDArray[np.float64] = np.geomspace(low, high, 200)
    zero = after.range_zero_mm - before.range_zero_mm
    return float(np.abs(zero - new.at(at).error_mm + old.at(at).error_mm).max())


def _largest_point_change(before: Calibration, after: Calibration) -> float:
    """Largest change of a point over a scan of 126 x 126 mm at 900 mm, without the ranging."""
    x, y = np.meshgrid(np.linspace(-FIELD_RAD, FIELD_RAD, 9), np.linspace(-FIELD_RAD, FIELD_RAD, 9))
    asked = np.column_stack([x.ravel(), y.ravel()])
    ranges = np.full(len(asked), AT_MM)
    old, new = (
        points_from(true_angles(asked, one.scanner), ranges, one.mirror_separation_mm) for one in (before, after)
    )
    return float(np.linalg.norm(new - old, axis=1).max())
