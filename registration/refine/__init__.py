"""The exact fit of a pose to the beams, along weak modes too, without the regions that are excluded."""

from picoradar.registration.refine.beam_fit import Final, exact_finish
from picoradar.registration.refine.exclusion import excluded_regions, outside_regions
from picoradar.registration.refine.weak_modes import dispersion, ends_beside, walked

__all__ = [
    "Final",
    "dispersion",
    "ends_beside",
    "exact_finish",
    "excluded_regions",
    "outside_regions",
    "walked",
]
