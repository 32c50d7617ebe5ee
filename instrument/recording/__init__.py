"""Recordings: one SQLite file a scan, durable line by line (layout in docs/recording.md)."""

from picoradar.instrument.recording.cloud import Cloud
from picoradar.instrument.recording.errors import RecordingError, from_sqlite
from picoradar.instrument.recording.findings import Event, LineCheck
from picoradar.instrument.recording.header import digest, plain, versions
from picoradar.instrument.recording.recording import Recording, open_recording

__all__ = [
    "Cloud",
    "Event",
    "LineCheck",
    "Recording",
    "RecordingError",
    "digest",
    "from_sqlite",
    "open_recording",
    "plain",
    "versions",
]
