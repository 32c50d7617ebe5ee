"""`in_step`: where a raster goes over a step between two surfaces.

A spot on the step sees a part of either surface, and no part tells its range from the other's: 10 mm are 67 ps of a
pulse of 600. The neighbours show the step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

STEP_MM = 2.0  # between two surfaces: a spot that lies half on either is off by half of it
SIGNIFICANT = 5.0
"""Standard deviations of a difference that noise does not reach: one false flag in a million points."""
SIGNIFICANT_STEP = 4.0
"""The same of a step, less what noise adds to the ways on both sides: one false flag in 30,000 points."""

ACROSS = (((1, 0), 1.0), ((1, 1), np.sqrt(2.0)), ((1, -1), np.sqrt(2.0)))
"""Directions (rows, columns) across the lines of a raster, and their lengths in steps of it."""


def in_step(
    around_mm: NDArray[np.float64], variances_mm2: NDArray[np.float64], limit_mm: float = STEP_MM
) -> NDArray[np.bool_]:
    """Return where the surface goes up or down by more than it does on both sides together.

    At the border of a raster, where there is nothing on one side, it is taken to go on there as on the other one.

    Parameters
    ----------
    around_mm, variances_mm2 : (5, N) float arrays
        Ranges of the points two and one to the one side of N points, of these, and of those one and two to the other
        side, with variances; NaN where there is none.
    limit_mm : float
        Least height of a step.
    """
    far, near, own, other, other_far = around_mm
    far_mm2, near_mm2, own_mm2, other_mm2, other_far_mm2 = variances_mm2
    before, behind = np.abs(near - far), np.abs(other_far - other)
    ways = (  # NaN where a point is missing
        (np.abs(other - near) - before - behind, 4.0 * (near_mm2 + other_mm2) + far_mm2 + other_far_mm2),
        (2.0 * (np.abs(other - own) - behind), 16.0 * other_mm2 + 4.0 * (own_mm2 + other_far_mm2)),
        (2.0 * (np.abs(near - own) - before), 16.0 * near_mm2 + 4.0 * (own_mm2 + far_mm2)),
    )
    asked = (np.True_, np.isnan(near), np.isnan(other))
    with np.errstate(invalid="ignore"):
        found = [
            one & (step_mm > limit_mm) & (step_mm > SIGNIFICANT_STEP * np.sqrt(noise_mm2))
            for (step_mm, noise_mm2), one in zip(ways, asked, strict=True)
        ]
    return np.asarray(np.any(found, axis=0), dtype=np.bool_)


def in_step_of_raster(
    range_mm: NDArray[np.float64],
    variance_mm2: NDArray[np.float64],
    rows: NDArray[np.int32],
    columns: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """Return which of N points of a whole raster lie in a step across its lines, in whatever order they come.

    A line by itself, and the one before, cannot show it: that takes the next one.
    """
    if not len(range_mm):
        return np.zeros(0, dtype=np.bool_)
    width = int(columns.max()) + 5  # two more on either side never reach the next row
    place = rows.astype(np.int64) * width + columns
    order = np.argsort(place, kind="stable")
    stepped = np.zeros(len(range_mm), dtype=np.bool_)
    for (down, right), length in ACROSS:
        ranges, variances = np.full((2, 5, len(range_mm)), np.nan)
        for k, far in enumerate((-2, -1, 0, 1, 2)):
            wanted = place + far * (down * width + right)
            found = order[np.minimum(np.searchsorted(place, wanted, sorter=order), len(order) - 1)]
            there = place[found] == wanted
            ranges[k, there], variances[k, there] = range_mm[found[there]], variance_mm2[found[there]]
        stepped |= in_step(ranges, variances, STEP_MM * length)
    return stepped & np.isfinite(range_mm)
