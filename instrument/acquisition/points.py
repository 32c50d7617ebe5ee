"""`to_scan_line`: the ranges of a line put into space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, covariance_from, points_from, true_angles
from picoradar.instrument.line import LineWindows, ScanLine
from picoradar.instrument.ranging import Ranges


def to_scan_line(
    row: int,
    columns: NDArray[np.int32],
    angles_rad: NDArray[np.float64],
    ranges: Ranges,
    calibration: Calibration,
    *,
    sums: NDArray[np.unsignedinteger] | None = None,
    windows: LineWindows | None = None,
    sweeps: int,
    began_s: float,
) -> ScanLine:
    """Put the ranges of a line into space.

    Parameters
    ----------
    row : int
    columns : (N,) int array
    angles_rad : (N, 2) float array
        Optical angles as asked for; the scanner's errors of the calibration are applied.
    ranges : Ranges
        Of N places.
    calibration : Calibration
    sums : (N, S) array, optional
        Raw traces to keep.
    windows : LineWindows, optional
        Raw windows to keep.
    sweeps : int
    began_s : float
        Device time at which the line was begun.
    """
    true_rad = true_angles(angles_rad, calibration.scanner)
    separation_mm = calibration.mirror_separation_mm
    return ScanLine(
        index=row,
        columns=columns,
        angles_rad=angles_rad,
        points_mm=points_from(true_rad, ranges.range_mm, separation_mm),
        covariance_mm2=covariance_from(
            true_rad, ranges.range_mm, ranges.variance_mm2, calibration.pointing_sd_rad, separation_mm
        ),
        range_mm=ranges.range_mm,
        range_variance_mm2=ranges.variance_mm2,
        response_mv=ranges.response_mv,
        flags=ranges.flags,
        sums=sums,
        sweeps=sweeps,
        device_time_s=began_s,
        windows=windows,
    )
