"""Recordings as files for other programs: written whole or not at all, read back before they count."""

from instrument.export.errors import ExportError
from instrument.export.exporting import FORMATS, export

__all__ = ["FORMATS", "ExportError", "export"]
