"""`geometry`: mirror separation, angle scales, offsets, non-orthogonality and range zero from scans of a flat plate.

Where the plate stands in each pose is estimated with them. One pose is held back and judges the result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.procedures.geometry.plane_fit import fit_planes
from picoradar.instrument.procedures.geometry.plane_poses import DEFAULT_POSES, HELD_BACK, Pose, next_pose
from picoradar.instrument.procedures.geometry.planes import PlaneScan, fitted_plane, points, values_of
from picoradar.instrument.procedures.geometry.report import describe
from picoradar.instrument.procedures.station.findings import lost_readings, refused
from picoradar.instrument.procedures.station.outcome import Outcome
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Station

NAME = "geometry"
FIELD_SHARE = 0.87  # of the scanner's field that a scan covers, with room for offsets of the mirrors
WANTED_GRAY = 0.70  # reflectance that gives about 50 mV at 1 m, where the timing walk is flat
MIN_INLIERS = 0.8
MISPLACED_MM = 40.0  # a scanner that is 1 deg off sees a plate turned by 55 deg 20 mm off
FLAT_FACTOR = 2.0  # noise about the planes over the ranging noise: above, what stands there is not flat
REMEDY = "Put the flat plate up in the poses asked for, so that it fills the scan, and run this again."


def run(
    station: Station,
    *,
    poses: Sequence[Pose] = DEFAULT_POSES,
    held_back: Pose = HELD_BACK,
    points_a_side: int = 24,
    averages: int | None = None,
) -> Outcome:
    """Scan the plate in every pose, fit the scanner's parameters, judge them on one more pose.

    Parameters
    ----------
    station : Station
    poses : sequence of Pose
        That calibrate.
    held_back : Pose
        That judges.
    points_a_side : int
        Rows and columns of each scan.
    averages : int, optional
        Sweeps a point; by default those of the settings.
    """
    taken: list[PlaneScan] = []
    for number, pose in enumerate([*poses, held_back]):
        station.progress(number / (len(poses) + 1), f"pose {number + 1} of {len(poses) + 1}: {pose}")
        scan, finding = _measured(station, number, pose, points_a_side, averages)
        if finding:
            return refused(NAME, finding, REMEDY)
        taken.append(scan)
    station.progress(1.0, "fitting")
    before = station.calibration
    fit = fit_planes(taken[:-1], before)
    if fit.inliers.mean() < MIN_INLIERS or fit.noise_factor > FLAT_FACTOR:
        return refused(NAME, _not_flat(fit.noise_factor, float(fit.inliers.mean())), REMEDY)
    how = f"bench procedure {NAME}: plate in {len(poses)} poses, {points_a_side} x {points_a_side} points each"
    calibration = station.stamped(fit.applied_to(before), f"{how}, {station.stage}; before: {before.provenance}")
    typical = taken[0]
    advice = next_pose(fit, before, typical.angles_rad, float(np.median(typical.variance_mm2)) ** 0.5)
    return describe(NAME, taken, before, calibration, fit, advice)


def _measured(
    station: Station, number: int, pose: Pose, points_a_side: int, averages: int | None
) -> tuple[PlaneScan, str]:
    """Scan one pose; also a finding in words when it cannot be used."""
    about_x, about_y = (math.cos(math.radians(tilt)) for tilt in pose.tilt_deg)
    gray = WANTED_GRAY * (pose.distance_mm / 1000.0) ** 2 / (about_x * about_y)
    placed = Placing("plate", pose.distance_mm, pose.tilt_deg, gray=round(min(gray, 0.95), 2))
    reported_mm = station.stage.place(placed)
    half_rad = FIELD_SHARE * math.radians(station.settings.scanner.field_deg) / 2
    half_rad /= 1.0 + 2.0 / (points_a_side - 1)  # lines begin a step outside
    measured = station.scan(
        f"pose-{number + 1:02d}",
        rows=points_a_side,
        columns=points_a_side,
        step_mm=2 * half_rad * pose.distance_mm / (points_a_side - 1),
        distance_mm=pose.distance_mm,
        averages=averages,
    )
    every = measured.reprocessed(station.best_method, station.calibration)
    cloud = every.with_range()
    offset_mm = reported_mm if pose.square else None
    scan = PlaneScan(cloud.angles_rad, cloud.range_mm, cloud.range_variance_mm2, offset_mm)
    finding = lost_readings(len(cloud), len(every), f"the plate at {pose}")
    return scan, finding or _misplaced(scan, pose, reported_mm, station.calibration)


def _misplaced(scan: PlaneScan, pose: Pose, reported_mm: float, calibration: Calibration) -> str:
    """Say that the target is no plate, or stands otherwise than asked for; empty when it fits."""
    where = points(scan, values_of(calibration), calibration.range_zero_mm)
    a, b, _ = plane = fitted_plane(where)
    normal = np.array([-a, -b, 1.0]) / math.sqrt(1 + a * a + b * b)
    off = where @ normal - plane[2]
    if float(np.median(np.abs(off))) > 1.0:
        return f"What stands at {pose} is not flat: half of its points are more than 1 mm off the best plane."
    middle_mm = float(plane[2] / normal[2])
    if abs(middle_mm - reported_mm) > MISPLACED_MM:
        return (
            f"The plate asked for at {pose} was found at {middle_mm:.1f} mm: move it, or correct the distance reported."
        )
    return ""


def _not_flat(factor: float, share: float) -> str:
    return (
        f"The points do not lie on planes: {100 * share:.0f} % of them fit, and these scatter {factor:.1f} times "
        "as much as ranging does. The plate is not flat, moved during a scan, or gray-target was not run."
    )
