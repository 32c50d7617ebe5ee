"""The robust method: the schedule of search and fit, and the second solution without dark points."""

from picoradar.registration.robust.brightness import without_dark_points
from picoradar.registration.robust.schedule import register_robust

__all__ = [
    "register_robust",
    "without_dark_points",
]
