"""Sizes that a point file may have; checked by what it states, before anything of it is unpacked or made."""

from __future__ import annotations

MOST_POINTS = 4_000_000
"""Points in one file: four times the largest raster that settings allow (1000 x 1000)."""

LARGEST_FILE_BYTES = 1_000_000_000
"""A point file, bytes: `MOST_POINTS` with ten columns of 25 characters."""

LARGEST_ARRAY_BYTES = 8 * 9 * MOST_POINTS
"""One array of an archive, unpacked, bytes: a covariance of 3 x 3 float64 for each of `MOST_POINTS`."""
