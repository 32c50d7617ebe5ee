"""The front doors: `register` for a scan that is done, `live` for one that is being made."""

from picoradar.registration.register.asked import check_noise, check_targets
from picoradar.registration.register.batch import register

__all__ = ["check_noise", "check_targets", "register"]
