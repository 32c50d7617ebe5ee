"""The scan that is registered: points and beams, raster neighbours, noise, response, bone or tissue."""

from picoradar.registration.scan.noise import (
    SIGMA_PER_MAD,
    NoiseModel,
    estimated_range_noise,
    initial_noise,
    mad_scale,
    raster_noise,
)
from picoradar.registration.scan.points import MIN_POINTS, Scan, checked_scan
from picoradar.registration.scan.raster import checked_grid
from picoradar.registration.scan.response import weighted_by_response
from picoradar.registration.scan.tissue import bone_probability, log_likelihood, neighbour_sum, observed_share

__all__ = [
    "MIN_POINTS",
    "SIGMA_PER_MAD",
    "NoiseModel",
    "Scan",
    "bone_probability",
    "checked_grid",
    "checked_scan",
    "estimated_range_noise",
    "initial_noise",
    "log_likelihood",
    "mad_scale",
    "neighbour_sum",
    "observed_share",
    "raster_noise",
    "weighted_by_response",
]
