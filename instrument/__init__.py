"""What an operator runs: controller, scans, ranging, calibration, bench procedures, recordings, command line.

The names below are what a program of your own needs; each is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from picoradar._lazy import lazy_names

if TYPE_CHECKING:
    from picoradar.instrument.bench import Bench, DeviceMaker, examine, make_bench
    from picoradar.instrument.calibration import Calibration
    from picoradar.instrument.controller import Controller
    from picoradar.instrument.errors import BadInput, Interrupted, PicoradarError
    from picoradar.instrument.files.export import export
    from picoradar.instrument.files.points import read_points
    from picoradar.instrument.line import Flag, ScanLine
    from picoradar.instrument.ranging import Ranges, estimate
    from picoradar.instrument.recording import Cloud, Recording, open_recording
    from picoradar.instrument.report import write_report
    from picoradar.instrument.settings import Settings, load_settings, to_toml

__all__ = [
    "BadInput",
    "Bench",
    "Calibration",
    "Cloud",
    "Controller",
    "DeviceMaker",
    "Flag",
    "Interrupted",
    "PicoradarError",
    "Ranges",
    "Recording",
    "ScanLine",
    "Settings",
    "estimate",
    "examine",
    "export",
    "load_settings",
    "make_bench",
    "open_recording",
    "read_points",
    "to_toml",
    "write_report",
]

_HOMES = {
    "BadInput": "errors",
    "Bench": "bench",
    "Calibration": "calibration",
    "Cloud": "recording",
    "Controller": "controller",
    "DeviceMaker": "bench",
    "Flag": "line",
    "Interrupted": "errors",
    "PicoradarError": "errors",
    "Ranges": "ranging",
    "Recording": "recording",
    "ScanLine": "line",
    "Settings": "settings",
    "estimate": "ranging",
    "examine": "bench",
    "export": "files.export",
    "load_settings": "settings",
    "make_bench": "bench",
    "open_recording": "recording",
    "read_points": "files.points",
    "to_toml": "settings",
    "write_report": "report",
}

__getattr__, __dir__ = lazy_names(__name__, _HOMES)
