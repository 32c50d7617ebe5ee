"""The incident log: every warning and failure of the radar, in a file outside of the recordings, bounded in size.

A recording tells of its own scan; what ended a program before there was one, or took the recording's disk with it,
stands here. Nothing of a patient is written: events of the instrument only.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sys
from collections.abc import MutableMapping
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path

from picoradar.instrument.events.log import JsonObject

MAX_BYTES = 1_000_000  # of one file: some thousand incidents
OLDER_FILES = 4
NAME = "incidents.log"
GRAVE = ("warning", "error", "critical")


def log_file() -> Path:
    """Get where incidents are written; ``PICORADAR_LOG`` names another folder.

    The folder of each system for what a program keeps of its runs (XDG base directories on Linux).
    """
    if named := os.environ.get("PICORADAR_LOG"):
        return Path(named) / NAME
    try:
        return _base() / "picoradar" / NAME
    except RuntimeError:  # a service or a container whose user has no home: nothing is kept, all else goes on
        return Path(os.devnull)


def _base() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Logs"
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")


class _SilentHandler(RotatingFileHandler):
    """Keeps quiet about a disk that is full."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Do nothing."""


class IncidentLog:
    """A processor of structlog that keeps what is grave, and passes everything on.

    A log that cannot be written (no home, a full disk) never changes what the radar does.

    Parameters
    ----------
    file : Path
        Made with its folder (mode 0700) at the first incident.
    """

    def __init__(self, file: Path) -> None:
        self._file = file

    def __call__(self, _logger: object, level: str, event: MutableMapping[str, object]) -> MutableMapping[str, object]:
        """Keep an event, if it is grave."""
        if level in GRAVE:
            with contextlib.suppress(OSError, ValueError, TypeError):
                self._write({"time": datetime.now(UTC).isoformat(timespec="milliseconds"), **event})
        return event

    def _write(self, incident: JsonObject) -> None:
        self._file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        text = json.dumps(incident, default=str)
        handler = _SilentHandler(self._file, maxBytes=MAX_BYTES, backupCount=OLDER_FILES, encoding="utf-8")
        with contextlib.closing(handler):
            handler.emit(logging.LogRecord("picoradar", logging.WARNING, "", 0, text, None, None))


def note_incident(event: str, **fields: object) -> None:
    """Write an incident that no logger has seen."""
    IncidentLog(log_file())(None, "error", {"level": "error", "event": event, **fields})


def last_incidents(count: int) -> list[JsonObject]:
    """Return the newest incidents, oldest first; empty when there are none or the log cannot be read."""
    try:
        lines = log_file().read_text(encoding="utf-8", errors="replace").splitlines()[-count:]
    except OSError:
        return []
    found = []
    for line in lines:
        with contextlib.suppress(ValueError):
            found.append(json.loads(line))
    return [incident for incident in found if isinstance(incident, dict)]
