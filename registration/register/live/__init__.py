"""Registration of a scan while it is being made, line by line."""

from picoradar.registration.register.live.line import Line, MeasuredLine
from picoradar.registration.register.live.live_registration import LiveRegistration
from picoradar.registration.register.live.options import RegisterOptions
from picoradar.registration.register.live.result import LiveResult, tre_mm

__all__ = ["Line", "LiveRegistration", "LiveResult", "MeasuredLine", "RegisterOptions", "tre_mm"]
