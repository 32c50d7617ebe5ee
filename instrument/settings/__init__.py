"""Settings of a bench: tables with units and ranges, reading and writing them, profiles to start from."""

from picoradar.instrument.settings.limits import (
    MAX_DISTANCE,
    MIN_DISTANCE,
    TRANSMITTER_HEAT,
    WATCHDOG,
    Limit,
    max_drive_v,
)
from picoradar.instrument.settings.reading import describe_errors, load_settings, override, settings_from
from picoradar.instrument.settings.tables import (
    METHODS,
    USB_BACKENDS,
    DiodeSettings,
    Links,
    Method,
    PulserSettings,
    ScannerSettings,
    Settings,
)
from picoradar.instrument.settings.writing import to_toml

__all__ = [
    "MAX_DISTANCE",
    "METHODS",
    "MIN_DISTANCE",
    "TRANSMITTER_HEAT",
    "USB_BACKENDS",
    "WATCHDOG",
    "DiodeSettings",
    "Limit",
    "Links",
    "Method",
    "PulserSettings",
    "ScannerSettings",
    "Settings",
    "describe_errors",
    "load_settings",
    "max_drive_v",
    "override",
    "settings_from",
    "to_toml",
]
