"""Point files: points for a registration, whatever program wrote them."""

from instrument.point_files.errors import PointFileError
from instrument.point_files.reading import SUFFIXES, PointFile, read_points

__all__ = ["SUFFIXES", "PointFile", "PointFileError", "read_points"]
