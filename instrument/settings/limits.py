"""Limits that safety rests on: each has its value, unit and source here, and nowhere else."""

from __future__ import annotations

import math
from typing import NamedTuple

from picoradar.drivers.interfaces import WATCHDOG_S


class Limit(NamedTuple):
    """A limit: ``value`` in ``unit``, and where it comes from."""

    value: float
    unit: str
    source: str


TRANSMITTER_HEAT = Limit(
    300.0**2 * 80_000.0,
    "V^2 Hz",
    "dissertation, section 2.6.1: above about 300 V at 80 kHz the transmitter overheats, and its heat goes with the "
    "rate times the voltage squared",
)
WATCHDOG = Limit(WATCHDOG_S, "s", "SBP 1.0, section 5, and the time that the bridge's driver sets in the device")
MIN_DISTANCE = Limit(620.0, "mm", "dissertation, section 2.5: nearer, reference and echo overlap")
MAX_DISTANCE = Limit(1000.0, "mm", "dissertation, chapter 1: reach that the radar was made and calibrated for")


def max_drive_v(prf_hz: float) -> float:
    """Return the drive voltage (V) above which the transmitter overheats at a rate (Hz)."""
    return math.sqrt(TRANSMITTER_HEAT.value / prf_hz)
