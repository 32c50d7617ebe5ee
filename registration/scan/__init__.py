"""The scan that is registered: points and beams, raster neighbours, noise, response, bone or tissue."""

from picoradar.registration.scan.noise import (
    PLAUSIBLE_RANGE_MM,
    TYPICAL_RANGE_MM,
    NoiseModel,
    estimated_range_noise,
    initial_noise,
)
from picoradar.registration.scan.points import Scan, checked_scan
from picoradar.registration.scan.response import weighted_by_response
from picoradar.registration.scan.tissue import (
    INDEPENDENT_POINTS,
    bone_probability,
    log_likelihood,
    neighbour_sum,
    raster_noise,
)

__all__ = [
    "INDEPENDENT_POINTS",
    "PLAUSIBLE_RANGE_MM",
    "TYPICAL_RANGE_MM",
    "NoiseModel",
    "Scan",
    "bone_probability",
    "checked_scan",
    "estimated_range_noise",
    "initial_noise",
    "log_likelihood",
    "neighbour_sum",
    "raster_noise",
    "weighted_by_response",
]
