"""The robust method: the schedule of search and fit, and the second solution without dark points."""

from picoradar.registration.robust.brightness import fitted_again, relative_brightness, without_dark_points
from picoradar.registration.robust.schedule import register_robust

__all__ = [
    "fitted_again",
    "register_robust",
    "relative_brightness",
    "without_dark_points",
]
