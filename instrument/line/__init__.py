"""One line of a scan: what crosses from the acquisition to its sinks."""

from picoradar.instrument.line.last_echo import LAST_ECHO, LastEcho
from picoradar.instrument.line.scan_line import NO_RANGE, ORIGIN_MM, SUSPECT, Flag, ScanLine, beams_to
from picoradar.instrument.line.steps import SIGNIFICANT, in_step, in_step_of_raster
from picoradar.instrument.line.stretch import StretchTerms, Unstretched, unstretched
from picoradar.instrument.line.windows import PULSES, LineWindows
from picoradar.instrument.line.zero import ZeroReading

__all__ = [
    "LAST_ECHO",
    "NO_RANGE",
    "ORIGIN_MM",
    "PULSES",
    "SIGNIFICANT",
    "SUSPECT",
    "Flag",
    "LastEcho",
    "LineWindows",
    "ScanLine",
    "StretchTerms",
    "Unstretched",
    "ZeroReading",
    "beams_to",
    "in_step",
    "in_step_of_raster",
    "unstretched",
]
