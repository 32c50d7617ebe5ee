"""Refusals of the export."""

from __future__ import annotations


class ExportError(ValueError):
    """A file cannot be written as asked: which, why, what to do."""
