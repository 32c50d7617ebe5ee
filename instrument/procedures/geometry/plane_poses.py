"""Poses of the plate: where to put it, and which one to add next."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from picoradar.instrument.calibration import Calibration, points_from, true_angles
from picoradar.instrument.procedures.geometry.plane_fit import OFFSET_SD_MM, PlaneFit
from picoradar.instrument.procedures.geometry.planes import (
    COUNT,
    FloatArray,
    PlaneScan,
    beams,
    errors_of,
    noise_of,
    normal_of,
)

NEAR_MM, FAR_MM = 700.0, 950.0
REACH_MM = (630.0, 1050.0)  # of every point of a scan
TILTS_DEG = (-55.0, -30.0, 0.0, 30.0, 55.0)


@dataclass(frozen=True)
class Pose:
    """A pose of the plate: distance along the beam at rest (mm), turns about x and y (deg)."""

    distance_mm: float
    tilt_deg: tuple[float, float] = (0.0, 0.0)

    @property
    def square(self) -> bool:
        """Get whether it stands square to the beam."""
        return self.tilt_deg == (0.0, 0.0)

    def __str__(self) -> str:
        return f"{self.distance_mm:g} mm, turned by {self.tilt_deg[0]:g} and {self.tilt_deg[1]:g} deg"


DEFAULT_POSES = (
    Pose(700.0),
    Pose(830.0),
    Pose(950.0),
    *(Pose(800.0, tilt) for tilt in ((55.0, 0.0), (-55.0, 0.0), (0.0, 55.0), (0.0, -55.0))),
    *(Pose(800.0, tilt) for tilt in ((35.0, 35.0), (-35.0, 35.0))),
)
HELD_BACK = Pose(820.0, (40.0, -40.0))


def plane_of(pose: Pose) -> FloatArray:
    """Return slopes and offset (3,) of the plane of a pose: turned about x, then about y, both fixed axes."""
    about_x, about_y = np.radians(pose.tilt_deg)
    normal = np.array([np.sin(about_y) * np.cos(about_x), -np.sin(about_x), np.cos(about_y) * np.cos(about_x)])
    return np.array([-normal[0] / normal[2], -normal[1] / normal[2], pose.distance_mm * normal[2]])


def next_pose(
    fit: PlaneFit, calibration: Calibration, raster_rad: FloatArray, range_sd_mm: float
) -> tuple[Pose, FloatArray]:
    """Find the pose that would reduce the uncertainty most.

    Parameters
    ----------
    fit : PlaneFit
        What is known so far.
    calibration : Calibration
        For the pointing noise.
    raster_rad : (N, 2) array
        Angles that are asked for in a scan.
    range_sd_mm : float
        Standard deviation of a range.

    Returns
    -------
    Pose
        Of those within reach, the one with the least sum of variances in units of the parameters' sizes.
    (7,) float array
        Standard deviations of the parameters with it.
    """
    known = np.linalg.inv(fit.covariance)
    sizes = fit.covariance.diagonal() ** 0.5
    best: tuple[float, Pose, FloatArray] | None = None
    for distance_mm, *tilt in product((NEAR_MM, 825.0, FAR_MM), TILTS_DEG, TILTS_DEG):
        pose = Pose(distance_mm, (tilt[0], tilt[1]))
        ranges = synthetic(pose, fit.values, raster_rad)
        if ranges.min() < REACH_MM[0] or ranges.max() > REACH_MM[1]:
            continue
        more = known + _information(pose, fit.values, calibration, raster_rad, range_sd_mm)
        sd = np.sqrt(np.linalg.inv(more).diagonal())
        score = float(np.sum((sd / sizes) ** 2))
        if best is None or score < best[0]:
            best = score, pose, sd
    if best is None:
        raise ValueError("there are no poses to choose from")
    return best[1], best[2]


def synthetic(pose: Pose, values: FloatArray, raster_rad: FloatArray) -> FloatArray:
    """Return the ranges (N,) mm at which the beams of a scanner with these parameters meet the plane of a pose."""
    plane = plane_of(pose)
    angles = true_angles(raster_rad, errors_of(values))
    start = points_from(angles, np.zeros(len(angles)), values[0])
    along = points_from(angles, np.ones(len(angles)), values[0]) - start
    return np.asarray((plane[2] - start @ normal_of(plane)) / (along @ normal_of(plane)))


def _information(
    pose: Pose, values: FloatArray, calibration: Calibration, raster_rad: FloatArray, range_sd_mm: float
) -> FloatArray:
    """Information (7, 7) on the parameters that a scan of this pose would add; its plane is unknown."""
    plane, zero_mm = plane_of(pose), float(values[6])
    ranges = synthetic(pose, values, raster_rad)
    scan = PlaneScan(raster_rad, ranges, np.full(len(ranges), range_sd_mm**2))
    seen = beams(scan, values, plane, zero_mm)
    sigma = noise_of(scan, seen, calibration.pointing_sd_rad)
    rows = np.column_stack([seen.by_values, seen.by_plane]) / sigma[:, None]
    joint = rows.T @ rows
    if pose.square:
        joint[-1, -1] += 1.0 / OFFSET_SD_MM**2
    return np.asarray(
        joint[:COUNT, :COUNT] - joint[:COUNT, COUNT:] @ np.linalg.solve(joint[COUNT:, COUNT:], joint[COUNT:, :COUNT])
    )
