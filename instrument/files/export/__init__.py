"""Recordings as files for other programs: written whole or not at all, read back before they count."""

from picoradar.instrument.files.export.errors import ExportError
from picoradar.instrument.files.export.exporting import FORMATS, export

__all__ = ["FORMATS", "ExportError", "export"]
