"""Point files: points for a registration, whatever program wrote them."""

from picoradar.instrument.files.points.errors import PointFileError
from picoradar.instrument.files.points.reading import SUFFIXES, PointFile, is_recording, read_points

__all__ = ["SUFFIXES", "PointFile", "PointFileError", "is_recording", "read_points"]
