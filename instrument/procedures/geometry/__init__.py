"""Bench procedure `geometry`: the scanner's parameters from planes."""

from picoradar.instrument.procedures.geometry.plane_fit import OFFSET_SD_MM, PlaneFit, fit_planes
from picoradar.instrument.procedures.geometry.plane_poses import DEFAULT_POSES, Pose, plane_of
from picoradar.instrument.procedures.geometry.planes import PARAMETERS, PlaneScan, normal_of, points

__all__ = [
    "DEFAULT_POSES",
    "OFFSET_SD_MM",
    "PARAMETERS",
    "PlaneFit",
    "PlaneScan",
    "Pose",
    "fit_planes",
    "normal_of",
    "plane_of",
    "points",
]
