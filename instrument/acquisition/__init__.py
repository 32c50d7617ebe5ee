"""How lines are taken: where the beam goes, how a place is sampled, and how records become points."""

from picoradar.instrument.acquisition.galvo_path import Stop, lay_path
from picoradar.instrument.acquisition.raster import LinePlan
from picoradar.instrument.acquisition.reprocess import rerange
from picoradar.instrument.acquisition.scan_raster import raster_of
from picoradar.instrument.acquisition.sweep import RasterScan
from picoradar.instrument.acquisition.window import WindowScan, can_window
from picoradar.instrument.acquisition.window_ranging import places_of

__all__ = [
    "LinePlan",
    "RasterScan",
    "Stop",
    "WindowScan",
    "can_window",
    "lay_path",
    "places_of",
    "raster_of",
    "rerange",
]
