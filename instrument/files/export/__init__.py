"""Recordings as files for other programs: written completely or not at all, and verified by reading back."""

from picoradar.instrument.files.export.errors import ExportError
from picoradar.instrument.files.export.exporting import FORMATS, export

__all__ = ["FORMATS", "ExportError", "export"]
