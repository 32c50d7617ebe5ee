"""What a bench procedure works with: the radar, a stage, raw readings, the outcome and its folder."""

from picoradar.instrument.procedures.station.folder import write_outcome
from picoradar.instrument.procedures.station.measured import Measured
from picoradar.instrument.procedures.station.outcome import Outcome
from picoradar.instrument.procedures.station.radar import Radar
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Progress, Station

__all__ = [
    "Measured",
    "Outcome",
    "Placing",
    "Progress",
    "Radar",
    "Station",
    "write_outcome",
]
