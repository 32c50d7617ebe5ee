"""`mark_footprint`: what the neighbours of a place tell of the surfaces under the spot.

Two surfaces a few millimetres apart give one echo that is hardly wider than that of one (10 mm are 67 ps of 600), at a
range between the two, wherever in the spot the edge lies. The pulse does not show it, but the neighbours do.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.line import Flag
from picoradar.instrument.ranging.ranges import Ranges

FloatArray = NDArray[np.float64]

SPOT_MM = 1.0  # diameter (1/e^2) of the spot on the target
DEEPEST_MM = 3.0  # a smooth surface under the spot has less depth: 72 degrees of incidence
PART_SHARE = 0.75  # of the neighbour's response: less shows that a part of the spot misses the surface
PART_SLOPE = 0.5  # and from this slope on (mm/mm) that moves the range by as much as its noise


class LineBefore(NamedTuple):
    """Ranges (N,) mm of the line before, and their variances (N,) mm^2."""

    range_mm: FloatArray
    variance_mm2: FloatArray


def mark_footprint(ranges: Ranges, step_mm: float, before: LineBefore | None) -> Ranges:
    """Flag places as `Flag.MIXED` whose spot does not lie on one smooth surface.

    These are places where the range changes by more than 3 mm over the spot, from one neighbour to the other or from
    the line before; and those at the rim of a sloped surface, where the response has dropped from one place to the next
    because only a part of the spot is still on it: the middle of that part is not the middle of the spot.

    Parameters
    ----------
    ranges : Ranges
        Of N places, from side to side.
    step_mm : float
        Distance of neighbouring places and lines.
    before : LineBefore or None
        Of the line before, if it is there.

    Returns
    -------
    Ranges
        With these flags added.
    """
    range_mm, response = ranges.range_mm, ranges.response_mv
    left, right = _neighbours(range_mm)
    with np.errstate(invalid="ignore"):
        sides = np.abs(np.stack([range_mm - left, right - range_mm])) / step_mm
        across = np.where(np.isfinite(left + right), np.abs(right - left) / (2 * step_mm), np.fmax(*sides))
        steep = across > DEEPEST_MM / SPOT_MM
        if before is not None:
            steep |= np.abs(range_mm - before.range_mm) > DEEPEST_MM / SPOT_MM * step_mm
        dropped = response < PART_SHARE * np.stack(_neighbours(response))
        partial = (dropped & (sides > PART_SLOPE)).any(axis=0)
    mixed = np.isfinite(range_mm) & (steep | partial)
    return replace(ranges, flags=np.where(mixed, ranges.flags | np.uint16(Flag.MIXED), ranges.flags))


def _neighbours(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the values to the left and to the right; NaN where there is none."""
    padded = np.pad(values, 1, constant_values=np.nan)
    return padded[:-2], padded[2:]
