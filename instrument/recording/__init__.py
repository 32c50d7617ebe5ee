"""Recordings: one SQLite file a scan, durable line by line (layout in docs/recording.md)."""

from instrument.recording.cloud import Cloud
from instrument.recording.errors import RecordingError
from instrument.recording.findings import Event, LineCheck
from instrument.recording.header import digest, plain, versions
from instrument.recording.recording import Recording

__all__ = ["Cloud", "Event", "LineCheck", "Recording", "RecordingError", "digest", "plain", "versions"]
