"""From traces to ranges: the interval between the time-significant points of reference and echo.

`estimate` ranges whole traces, `estimate_windows` and `estimate_places` windowed records that `WindowPlanner` has
planned. `learn` and `fit_walk` make the calibration that they need, `range_bound_mm2` tells how good they can be.
"""

from instrument.ranging.average import average_ranges, average_sweeps
from instrument.ranging.bound import Pulse, range_bound_mm2
from instrument.ranging.estimate import estimate
from instrument.ranging.footprint import mark_footprint
from instrument.ranging.learning import learn
from instrument.ranging.ranges import SPEED_OF_LIGHT_MM_PER_PS, Ranges
from instrument.ranging.settings import RangingSettings
from instrument.ranging.walk import fit_walk
from instrument.ranging.window import Place, Window
from instrument.ranging.window_choice import PlanSettings
from instrument.ranging.window_plan import WindowPlanner
from instrument.ranging.window_traces import WindowTraces
from instrument.ranging.windowed import estimate_places, estimate_windows, with_retaken

__all__ = [
    "SPEED_OF_LIGHT_MM_PER_PS",
    "Place",
    "PlanSettings",
    "Pulse",
    "Ranges",
    "RangingSettings",
    "Window",
    "WindowPlanner",
    "WindowTraces",
    "average_ranges",
    "average_sweeps",
    "estimate",
    "estimate_places",
    "estimate_windows",
    "fit_walk",
    "learn",
    "mark_footprint",
    "range_bound_mm2",
    "with_retaken",
]
