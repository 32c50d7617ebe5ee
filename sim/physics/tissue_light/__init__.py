"""Light that enters bone, tissue or paint and comes back to the receiver later than that of the surface."""

from picoradar.sim.physics.tissue_light.optical import Optical
from picoradar.sim.physics.tissue_light.response import TimeResponse, on_grid, shipped_table, time_response

__all__ = ["Optical", "TimeResponse", "on_grid", "shipped_table", "time_response"]
