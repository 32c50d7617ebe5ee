"""Events of a run: structured log lines, and the log of incidents outside of the recordings."""

from picoradar.instrument.events.incidents import IncidentLog, last_incidents, log_file, note_incident
from picoradar.instrument.events.log import JsonObject, Log, configure, logger

__all__ = [
    "IncidentLog",
    "JsonObject",
    "Log",
    "configure",
    "last_incidents",
    "log_file",
    "logger",
    "note_incident",
]
