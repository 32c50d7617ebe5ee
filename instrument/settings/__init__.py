"""Settings of a bench: tables with units and ranges, reading and writing them, profiles to start from."""

from picoradar.instrument.settings.reading import describe_errors, load_settings, override, settings_from
from picoradar.instrument.settings.tables import Links, PulserSettings, ScannerSettings, Settings
from picoradar.instrument.settings.writing import to_toml

__all__ = [
    "Links",
    "PulserSettings",
    "ScannerSettings",
    "Settings",
    "describe_errors",
    "load_settings",
    "override",
    "settings_from",
    "to_toml",
]
