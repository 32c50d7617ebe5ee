"""Files for other programs: point files that are read, exports that are written."""
