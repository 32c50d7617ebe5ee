"""Live registration: a pose, its predicted errors and a verdict after every line of a scan (docs/live.md)."""

from picoradar.registration.register.live import (
    Line,
    LiveRegistration,
    LiveResult,
    MeasuredLine,
    RegisterOptions,
    tre_mm,
)

__all__ = ["Line", "LiveRegistration", "LiveResult", "MeasuredLine", "RegisterOptions", "tre_mm"]
