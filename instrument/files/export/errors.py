"""Refusals of the export."""

from __future__ import annotations

from picoradar.instrument.errors import BadInput


class ExportError(BadInput):
    """A file cannot be written as asked: which, why, what to do."""
