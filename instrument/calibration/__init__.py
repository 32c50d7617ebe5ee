"""Calibrations: the file, its parts, its checks, and the scanner's geometry that it describes."""
