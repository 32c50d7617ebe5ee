"""From the raw windows of a line to its ranges: the same way while the scan runs and when it is reprocessed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.line import LineWindows
from picoradar.instrument.ranging import PointWindows, Ranges, estimate_points, with_retaken


def range_windows(windows: LineWindows, calibration: Calibration) -> Ranges:
    """Range the records of one run; the points of a line share their reference."""
    return estimate_points(
        point_windows_of(windows),
        windows.traces_mv(),
        calibration=calibration,
        clipped=windows.clipped,
        shared_reference=True,
    )


def range_line(columns: NDArray[np.int32], windows: LineWindows, calibration: Calibration) -> Ranges:
    """Range the windows of a whole line, those that were taken again included.

    Parameters
    ----------
    columns : (N,) int array
        Of the line's points, in their order.
    windows : LineWindows
        One record of each point first, then those taken again.
    calibration : Calibration
    """
    ranges = range_windows(windows.where(~windows.retaken), calibration)
    again = windows.where(windows.retaken)
    if not len(again):
        return ranges
    points = np.array([int(np.flatnonzero(columns == column)[0]) for column in again.columns], dtype=np.intp)
    return with_retaken(ranges, points, range_windows(again, calibration))


def point_windows_of(windows: LineWindows) -> list[PointWindows]:
    """Return the windows as the planner has made them."""
    return [
        PointWindows(reference, echo, wide=retaken)
        for (reference, echo), retaken in zip(windows.table(), windows.retaken.tolist(), strict=True)
    ]
