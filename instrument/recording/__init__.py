"""Recordings: one SQLite file a scan, durable line by line (layout in docs/recording.md)."""

from picoradar.instrument.recording.cloud import Cloud, cloud_of, range_error_in, range_error_left
from picoradar.instrument.recording.errors import RecordingError, from_sqlite
from picoradar.instrument.recording.findings import Event, LineCheck
from picoradar.instrument.recording.header import check_range_error, digest, plain, versions
from picoradar.instrument.recording.names import free_stillborn, refuse_unwritable
from picoradar.instrument.recording.recording import Recording, open_recording
from picoradar.instrument.recording.salvage import salvage
from picoradar.instrument.recording.window_layout import in_fs

__all__ = [
    "Cloud",
    "Event",
    "LineCheck",
    "Recording",
    "RecordingError",
    "check_range_error",
    "cloud_of",
    "digest",
    "free_stillborn",
    "from_sqlite",
    "in_fs",
    "open_recording",
    "plain",
    "range_error_in",
    "range_error_left",
    "refuse_unwritable",
    "salvage",
    "versions",
]
