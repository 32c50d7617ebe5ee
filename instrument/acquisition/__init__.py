"""How lines are taken: a plan (where the beam goes), a capture (how a point is sampled), and the job made of both."""

from picoradar.instrument.acquisition.acquisition import Acquisition
from picoradar.instrument.acquisition.capture import Capture, Captured, Devices, Revisit, Setup
from picoradar.instrument.acquisition.galvo_path import Stop, plan_path
from picoradar.instrument.acquisition.jobs import monitor_scan, points_scan, raster_scan
from picoradar.instrument.acquisition.line import reprocessed
from picoradar.instrument.acquisition.line_size import refuse_enormous_lines
from picoradar.instrument.acquisition.motion import MotionMonitor
from picoradar.instrument.acquisition.plan import LinePlan, Plan
from picoradar.instrument.acquisition.points import MonitorPlan, PointsPlan
from picoradar.instrument.acquisition.raster import RasterPlan
from picoradar.instrument.acquisition.reprocess import reprocess
from picoradar.instrument.acquisition.sweep import SweepCapture, sweep_of
from picoradar.instrument.acquisition.window import WindowCapture, can_window
from picoradar.instrument.acquisition.window_ranging import point_windows_of
from picoradar.instrument.acquisition.zero_check import PLATE, plate_range, zero_check_of, zero_sd_mm
from picoradar.instrument.acquisition.zero_mark import MarkPlan

__all__ = [
    "PLATE",
    "Acquisition",
    "Capture",
    "Captured",
    "Devices",
    "LinePlan",
    "MarkPlan",
    "MonitorPlan",
    "MotionMonitor",
    "Plan",
    "PointsPlan",
    "RasterPlan",
    "Revisit",
    "Setup",
    "Stop",
    "SweepCapture",
    "WindowCapture",
    "can_window",
    "monitor_scan",
    "plan_path",
    "plate_range",
    "point_windows_of",
    "points_scan",
    "raster_scan",
    "refuse_enormous_lines",
    "reprocess",
    "reprocessed",
    "sweep_of",
    "zero_check_of",
    "zero_sd_mm",
]
