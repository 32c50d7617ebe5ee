"""What a report says: verdict, key figures and facts in words, from the results."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from picoradar.instrument.events import JsonObject
from picoradar.instrument.recording import Cloud, Recording, range_error_in
from picoradar.instrument.report.page import Banner
from picoradar.instrument.report.registered import RegisteredScan
from picoradar.instrument.report.style import LIMITS_MM

if TYPE_CHECKING:
    from picoradar.registration import Registration, Target

_VERDICTS = {
    "pass": ("✔", "PASSED", "The pose of the bone is found, and the data hold it in all directions."),
    "caution": ("▲", "CAUTION", "A pose is found, but it must not be used without a second look."),
    "fail": ("✖", "FAILED", "The pose must not be used."),
}


def banners(recording: Recording, registered: RegisteredScan | None) -> list[Banner]:
    """Return what one sees first: the verdict, and a warning if the laser was not verified off or the pose is wrong."""
    found = []
    if recording.laser_off_verified is False:
        what = "The read-back after the scan did not show the laser off. Check the bench before anybody comes near it."
        found.append(Banner("fail", "✖", "LASER OFF NOT VERIFIED", [what]))
    if not recording.complete:
        lines = f"{len(recording.done)} of {recording.raster['rows']} lines are there."
        found.append(
            Banner("caution", "▲", "SCAN NOT COMPLETE", [f"{lines} Ended: {recording.stop_reason or 'never closed'}."])
        )
    if registered is None:
        if recording.complete:
            found.append(Banner("plain", "✔", "SCAN COMPLETE", ["Not registered."]))
        return found
    registration = registered.registration
    if registered.known_wrong:
        limit = (
            f"the tolerance of {registered.tolerance.rotation_deg:g} degree or {registered.tolerance.target_mm:g} mm"
        )
        if registered.beyond_stated:
            limit = f"the {number(registered.stated_mm, 'mm')} stated at the targets"
        what = f"The simulated bench knows the true pose: the error is above {limit}."
        found.append(Banner("fail", "✖", "WRONG POSE", [what]))
    symbol, word, sentence = _VERDICTS[registration.verdict]
    found.append(Banner(registration.verdict, symbol, word, [sentence, *registration.reasons]))
    return found


def figures(cloud: Cloud, registered: RegisteredScan | None) -> list[tuple[str, str]]:
    """Return the few numbers that count, as (value with unit, name)."""
    points = int(cloud.has_range.sum())
    found = []
    registration = None if registered is None else registered.registration
    if registration is not None:
        worst = worst_target(registration)
        if worst is not None:
            known = math.isfinite(worst.bias_mm)
            bias = "a common range error included" if known else "but a common range error was never measured"
            value = worst.stated_mm if known else worst.p95_mm
            found.append((number(value, "mm"), f"predicted error at {worst.name}, not exceeded in 95 %, {bias}"))
        found.append((number(registration.predicted_rotation_deg, "°"), "predicted rotation error, root mean square"))
    if registered is not None and registered.truth_error is not None:
        tre_mm = registered.truth_error["tre_mm"]
        found.append((number(tre_mm, "mm"), "true error at the target (simulated bench)"))
    if registration is not None:
        near = float(np.mean(np.abs(registration.residuals) <= LIMITS_MM[0]))
        found.append((f"{100 * near:.1f} %", "of the points within 1 mm of the model"))
    else:
        found.append((f"{100 * points / max(len(cloud), 1):.1f} %", "of the points gave a range"))
    found.append((str(points), f"ranges of {len(cloud)} points"))
    return found


def facts(
    recording: Recording, cloud: Cloud, registered: RegisteredScan | None, summary: JsonObject
) -> list[tuple[str, str]]:
    """Return the table of key figures, as (name, value)."""
    found = [] if registered is None else _facts_of_registration(registered)
    raster = recording.raster
    grid = f"{raster['rows']} x {raster['columns']} points"
    step, averages = raster.get("step_mm"), raster.get("averages")
    found.append(
        ("raster", grid + (f", {step:g} mm apart" if step else "") + (f", {averages} averages" if averages else ""))
    )
    found.append(("target, and range error taken off", range_error_words(range_error_in(recording.header, cloud))))
    scan = summary.get("scan", {})
    if isinstance(scan, Mapping) and scan.get("device_time_s") is not None:
        shots = scan.get("shot_limited_s")
        limit = f" ({shots:.1f} s of it for the laser's shots)" if shots is not None else ""
        found.append(("time of the scan on the device", f"{scan['device_time_s']:.1f} s{limit}"))
    if isinstance(scan, Mapping) and isinstance(check := scan.get("zero_check"), Mapping):
        found.append(("range zero", str(check.get("sentence"))))
    found.append(("flagged points", flag_counts(cloud)))
    found.append(("places with two echoes", two_echo_words(cloud)))
    off = {True: "yes, read back", False: "NO", None: "the scan was never closed"}[recording.laser_off_verified]
    found.append(("laser off at the end", off))
    found.append(("scan ended", recording.stop_reason or "never closed"))
    return found


def _facts_of_registration(registered: RegisteredScan) -> list[tuple[str, str]]:
    registration, tolerance = registered.registration, registered.tolerance
    found = [
        ("residuals: root mean square, mean, largest", _triple(registration)),
        ("points taken for bone", f"{int(registration.inliers.sum())} of {len(registration.inliers)}"),
        ("weakest motions", "; ".join(registration.weak_directions) or "none"),
        ("tolerance of the verdict", f"{tolerance.rotation_deg:g}° and {tolerance.target_mm:g} mm at the targets"),
    ]
    found += [
        (
            f"predicted error at {target.name}",
            f"{number(target.rms_mm, 'mm')} rms, {number(target.p95_mm, 'mm')} in 95 %, {_common(target)}",
        )
        for target in registration.targets
    ]
    if registered.truth_error is not None:
        names = (("rotation_deg", "°"), ("translation_mm", "mm"), ("tre_mm", "mm"))
        values = (number(registered.truth_error[name], unit) for name, unit in names)
        found.append(("true error (simulated bench): rotation, translation, at the target", ", ".join(values)))
    return found


def range_error_words(known: JsonObject) -> str:
    """Say what a recording knows of the range error that all its points share."""
    if not (material := known.get("material")):
        return "material not stated, nothing taken off"
    if (sd_mm := known.get("sd_mm")) is None:
        return f"{material}, whose range error was never measured with this radar; nothing taken off"
    words = f"{material}, {number(known['bias_mm'], 'mm')}; standard deviation left {number(sd_mm, 'mm')}"
    if "stretch" not in known:
        return words
    return f"{words}; by the stretch of the echoes, {known['stretch']:.2f} of that of the piece that was measured"


def _common(target: Target) -> str:
    if math.isnan(target.bias_mm):
        return "a common range error was never measured"
    sd, stated = number(target.bias_mm, "mm"), number(target.stated_mm, "mm")
    return f"{stated} with a common range error of standard deviation {sd}"


def flag_counts(cloud: Cloud) -> str:
    """Return how many points carry which flag, in words."""
    return ", ".join(f"{words}: {count}" for words, count in cloud.flag_counts.items()) or "none"


def two_echo_words(cloud: Cloud) -> str:
    """Say at how many places two echoes were told apart, and how far apart they are."""
    points = cloud.with_range()
    two = points.where(points.two_echoes)
    if not len(two):
        return "none told apart"
    low, middle, high = np.percentile(two.last_range_mm - two.range_mm, [0, 50, 100])
    apart = f"{number(middle, 'mm')} apart in the middle ({number(low, 'mm')} to {number(high, 'mm')})"
    return f"{len(two)} of {len(points)}, {apart}; the point is the first of the two"


def worst_target(registration: Registration) -> Target | None:
    """Return the target with the largest predicted error."""
    return max(registration.targets, key=lambda t: t.p95_mm if math.isnan(t.stated_mm) else t.stated_mm, default=None)


def number(value: float, unit: str) -> str:
    """Return a number with its unit, to a thousandth where it is small; infinite means a motion that nothing holds."""
    if not math.isfinite(value):
        return "without bound"
    digits = 3 if abs(value) < 1 else 2 if abs(value) < 10 else 1
    return f"{value:.{digits}f}{'' if unit == '°' else ' '}{unit}"


def _triple(registration: Registration) -> str:
    values = (registration.rms_mm, registration.mean_mm, registration.max_mm)
    return ", ".join(number(value, "mm") for value in values)
