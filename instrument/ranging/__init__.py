"""From traces to ranges: the interval between the time-significant points of reference and echo."""

from instrument.ranging.estimate import estimate
from instrument.ranging.ranges import SPEED_OF_LIGHT_MM_PER_PS, Ranges
from instrument.ranging.settings import RangingSettings

__all__ = ["SPEED_OF_LIGHT_MM_PER_PS", "Ranges", "RangingSettings", "estimate"]
