"""The beam fit of a pose, beside weak ones too, without the regions that are excluded."""

from picoradar.registration.refine.annealing import annealed
from picoradar.registration.refine.beam_fit import BeamFit, BeamFitter
from picoradar.registration.refine.cast_beams import CastBeams
from picoradar.registration.refine.edge_forgiving import edge_forgiving_likelihood
from picoradar.registration.refine.exclusion import excluded_regions, outside_regions
from picoradar.registration.refine.shallow_modes import alternatives_at, shallow_poses
from picoradar.registration.refine.weak_modes import (
    alternatives_of,
    beside_weak,
    dispersion,
    motion_between,
    observed_information,
)

__all__ = [
    "BeamFit",
    "BeamFitter",
    "CastBeams",
    "alternatives_at",
    "alternatives_of",
    "annealed",
    "beside_weak",
    "dispersion",
    "edge_forgiving_likelihood",
    "excluded_regions",
    "motion_between",
    "observed_information",
    "outside_regions",
    "shallow_poses",
]
