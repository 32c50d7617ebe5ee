"""The beam fit of a pose, along weak modes too, without the regions that are excluded."""

from picoradar.registration.refine.annealing import annealed
from picoradar.registration.refine.beam_fit import BeamFit, BeamFitter
from picoradar.registration.refine.cast_beams import CastBeams
from picoradar.registration.refine.edge_forgiving import edge_forgiving_likelihood
from picoradar.registration.refine.exclusion import excluded_regions, outside_regions
from picoradar.registration.refine.shallow_modes import alternatives_at, shallow_poses
from picoradar.registration.refine.weak_modes import along_weak_mode, alternatives_of, dispersion

__all__ = [
    "BeamFit",
    "BeamFitter",
    "CastBeams",
    "along_weak_mode",
    "alternatives_at",
    "alternatives_of",
    "annealed",
    "dispersion",
    "edge_forgiving_likelihood",
    "excluded_regions",
    "outside_regions",
    "shallow_poses",
]
