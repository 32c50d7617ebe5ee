"""What a method of registration hands over for assessment, and the measures of residuals and poses."""

from picoradar.registration.solution.handover import Alternative, Rival, Solution
from picoradar.registration.solution.measures import (
    Iteration,
    PoseError,
    ResidualMeasures,
    pose_error,
    residual_measures,
)

__all__ = [
    "Alternative",
    "Iteration",
    "PoseError",
    "ResidualMeasures",
    "Rival",
    "Solution",
    "pose_error",
    "residual_measures",
]
