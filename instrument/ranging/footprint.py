"""`mark_footprint`: what the neighbours of a point tell of the surfaces under its spot.

Two surfaces a few millimetres apart give one echo that is hardly wider than that of one (10 mm are 67 ps of 600), at a
range between the two, wherever in the spot the edge lies. The pulse does not show it, but the neighbours do.

The neighbours that are compared lie half a spot away on either side, or one step where that is more: nearer ones share
most of their spot, and the difference of their ranges is noise. A difference counts as depth only where noise does not
explain it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.line import SIGNIFICANT, Flag, in_step
from picoradar.instrument.ranging.ranges import Ranges

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SPOT_MM = 1.0  # diameter (1/e^2) of the spot on the target
DEEPEST_MM = 3.0  # a smooth surface under the spot has less depth: 72 degrees of incidence
PART_SHARE = 0.75  # of the neighbour's response: less shows that a part of the spot misses the surface
PART_SLOPE = 0.5  # and from this slope on (mm/mm) that moves the range by as much as its noise


class LineBefore(NamedTuple):
    """Ranges (N,) mm of the line before, and their variances (N,) mm^2."""

    range_mm: FloatArray
    variance_mm2: FloatArray


def mark_footprint(ranges: Ranges, step_mm: float, before: LineBefore | None) -> Ranges:
    """Flag points as `Flag.MIXED` whose spot does not lie on one smooth surface.

    These are points where the range changes by more than 3 mm over the spot, and by more than its noise, from one
    neighbour to the other or from the line before; points in a step of more than 2 mm between two surfaces, of which
    the spot may see either; and those at the rim of a sloped surface, where the response has
    dropped from one point to the next because only a part of the spot is still on it: the middle of that part is not
    the middle of the spot.

    Parameters
    ----------
    ranges : Ranges
        Of N points, from side to side.
    step_mm : float
        Distance of neighbouring points and lines.
    before : LineBefore or None
        Of the line before, if it is there.

    Returns
    -------
    Ranges
        With these flags added.
    """
    range_mm, variance_mm2, response = ranges.range_mm, ranges.variance_mm2, ranges.response_mv
    reach = max(1, round(SPOT_MM / 2 / step_mm))
    limit_mm = DEEPEST_MM / SPOT_MM * step_mm * reach
    left, right = _neighbours(range_mm, reach)
    left_mm2, right_mm2 = _neighbours(variance_mm2, reach)
    with np.errstate(invalid="ignore"):
        sides = np.abs(np.stack([range_mm - left, right - range_mm]))
        one_sided = _deep(sides, np.stack([left_mm2, right_mm2]) + variance_mm2, limit_mm).any(axis=0)
        two_sided = _deep(np.abs(right - left), left_mm2 + right_mm2, 2 * limit_mm)
        steep = np.where(np.isfinite(left + right), two_sided, one_sided)
        if before is not None:
            change = np.abs(range_mm - before.range_mm)
            steep |= _deep(change, variance_mm2 + before.variance_mm2, DEEPEST_MM / SPOT_MM * step_mm)
        steep |= _step(range_mm, variance_mm2)
        dropped = response < PART_SHARE * np.stack(_neighbours(response, reach))
        partial = (dropped & (sides > PART_SLOPE * step_mm * reach)).any(axis=0)
    mixed = np.isfinite(range_mm) & (steep | partial)
    return replace(ranges, flags=np.where(mixed, ranges.flags | np.uint16(Flag.MIXED), ranges.flags))


def _deep(difference_mm: FloatArray, variance_mm2: FloatArray, limit_mm: float) -> BoolArray:
    """Return where a difference of ranges (mm) is beyond the limit, and beyond what its variance explains."""
    return np.asarray((difference_mm > limit_mm) & (difference_mm > SIGNIFICANT * np.sqrt(variance_mm2)))


def _step(range_mm: FloatArray, variance_mm2: FloatArray) -> BoolArray:
    """Return where the surface goes up or down by more than it does on both sides together."""
    around_mm, variances_mm2 = (
        np.stack([farther_left, left, values, right, farther_right])
        for values, (left, right), (farther_left, farther_right) in (
            (values, _neighbours(values, 1), _neighbours(values, 2)) for values in (range_mm, variance_mm2)
        )
    )
    return in_step(around_mm, variances_mm2)


def _neighbours(values: FloatArray, reach: int) -> tuple[FloatArray, FloatArray]:
    """Return the values so many points to the left and to the right; NaN where there is none."""
    padded = np.pad(values, reach, constant_values=np.nan)
    return padded[: -2 * reach], padded[2 * reach :]
