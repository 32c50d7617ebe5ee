"""One line of a scan: what crosses from the acquisition to its sinks."""

from picoradar.instrument.line.scan_line import NO_RANGE, SUSPECT, Flag, ScanLine
from picoradar.instrument.line.windows import PULSES, LineWindows

__all__ = [
    "NO_RANGE",
    "PULSES",
    "SUSPECT",
    "Flag",
    "LineWindows",
    "ScanLine",
]
