"""From traces to ranges: the interval between the time-significant points of reference and echo.

`estimate` ranges whole traces, `estimate_windows` and `estimate_points` windowed records that `WindowPlanner` has
planned. `learn` and `fit_walk` make the calibration that they need, `range_bound_mm2` tells how good they can be.
"""

from picoradar.drivers.traces import Window
from picoradar.instrument.ranging.average import average_ranges, average_sweeps
from picoradar.instrument.ranging.bound import Pulse, range_bound_mm2
from picoradar.instrument.ranging.estimate import estimate
from picoradar.instrument.ranging.footprint import LineBefore, mark_footprint
from picoradar.instrument.ranging.learning import learn
from picoradar.instrument.ranging.ranges import RANGE_PER_INTERVAL_MM_PER_PS, SPEED_OF_LIGHT_MM_PER_PS, Ranges
from picoradar.instrument.ranging.scaling import OtherPulse
from picoradar.instrument.ranging.self_calibration import learn_moving
from picoradar.instrument.ranging.settings import AveragingSettings, LearningSettings, RangingSettings, WalkSettings
from picoradar.instrument.ranging.stretch_learning import Leftover, learn_stretch, left_of_echoes
from picoradar.instrument.ranging.walk import fit_walk
from picoradar.instrument.ranging.windows.choice import PlanSettings
from picoradar.instrument.ranging.windows.estimate import estimate_points, estimate_windows, with_retaken
from picoradar.instrument.ranging.windows.fit import PointWindows
from picoradar.instrument.ranging.windows.plan import WindowPlanner
from picoradar.instrument.ranging.windows.traces import WindowTraces

__all__ = [
    "RANGE_PER_INTERVAL_MM_PER_PS",
    "SPEED_OF_LIGHT_MM_PER_PS",
    "AveragingSettings",
    "LearningSettings",
    "Leftover",
    "LineBefore",
    "OtherPulse",
    "PlanSettings",
    "PointWindows",
    "Pulse",
    "Ranges",
    "RangingSettings",
    "WalkSettings",
    "Window",
    "WindowPlanner",
    "WindowTraces",
    "average_ranges",
    "average_sweeps",
    "estimate",
    "estimate_points",
    "estimate_windows",
    "fit_walk",
    "learn",
    "learn_moving",
    "learn_stretch",
    "left_of_echoes",
    "mark_footprint",
    "range_bound_mm2",
    "with_retaken",
]
