"""From the raw windows of a line to its ranges: the same way while the scan runs and when it is ranged again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.line import LineWindows
from picoradar.instrument.ranging import Place, Ranges, Window, estimate_places, with_retaken


class CodeScale(NamedTuple):
    """Codes of the A/D: that of 0 V, and mV at the photodiode for each."""

    zero_code: float
    mv_per_code: float


def range_windows(windows: LineWindows, scale: CodeScale, calibration: Calibration) -> Ranges:
    """Range the records of one run; the places of a line share their reference."""
    sweeps = windows.sweeps.ravel()
    traces = [
        (sums / float(count) - scale.zero_code) * scale.mv_per_code
        for sums, count in zip(windows.pieces(), sweeps, strict=True)
    ]
    return estimate_places(
        places_of(windows),
        list(zip(traces[::2], traces[1::2], strict=True)),
        calibration=calibration,
        clipped=windows.clipped,
        shared_reference=True,
    )


def range_line(columns: NDArray[np.int32], windows: LineWindows, scale: CodeScale, calibration: Calibration) -> Ranges:
    """Range the windows of a whole line, those that were taken again included.

    Parameters
    ----------
    columns : (N,) int array
        Of the line's places, in their order.
    windows : LineWindows
        One record of each place first, then those taken again.
    """
    ranges = range_windows(windows.where(~windows.retaken), scale, calibration)
    again = windows.where(windows.retaken)
    if not len(again):
        return ranges
    places = np.array([int(np.flatnonzero(columns == column)[0]) for column in again.columns], dtype=np.intp)
    return with_retaken(ranges, places, range_windows(again, scale, calibration))


def places_of(windows: LineWindows) -> list[Place]:
    """Return the windows as the planner has made them."""
    flat = [
        Window(start_fs / 1000, step_fs / 1000, samples, sweeps)
        for start_fs, step_fs, samples, sweeps in zip(
            *(getattr(windows, name).ravel().tolist() for name in ("start_fs", "step_fs", "samples", "sweeps")),
            strict=True,
        )
    ]
    return [
        Place(reference, echo, wide=retaken)
        for reference, echo, retaken in zip(flat[::2], flat[1::2], windows.retaken.tolist(), strict=True)
    ]
