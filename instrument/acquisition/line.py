"""Ranges put into space: `to_scan_line` for a line just taken, `reprocessed` for one ranged before."""

from __future__ import annotations

from dataclasses import replace
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.acquisition.capture import Captured
from picoradar.instrument.acquisition.plan import LinePlan
from picoradar.instrument.calibration import Calibration, covariance_from, points_from, true_angles
from picoradar.instrument.line import ScanLine
from picoradar.instrument.ranging import Ranges


def to_scan_line(plan: LinePlan, captured: Captured, calibration: Calibration, began_s: float) -> ScanLine:
    """Put a captured line into space; its raw samples go along.

    Parameters
    ----------
    plan : LinePlan
        Its optical angles are those asked for; the scanner's errors of the calibration are applied.
    captured : Captured
        Of the N points of the plan.
    calibration : Calibration
    began_s : float
        Device time at which the line was begun.
    """
    return ScanLine(
        index=plan.row,
        columns=plan.columns,
        angles_rad=plan.angles_rad,
        traces=captured.traces,
        sweeps=captured.sweeps,
        device_time_s=began_s,
        windows=captured.windows,
        **_ranged(plan.angles_rad, captured.ranges, calibration),
    )


def reprocessed(line: ScanLine, ranges: Ranges, calibration: Calibration) -> ScanLine:
    """Return a line with other ranges (N,) of its points, by a calibration that may be another one, too."""
    return replace(line, **_ranged(line.angles_rad, ranges, calibration))


class _Ranged(TypedDict):
    """What a line has of the ranges of its N points; as in `ScanLine`."""

    points_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float64]
    range_mm: NDArray[np.float64]
    range_variance_mm2: NDArray[np.float64]
    response_mv: NDArray[np.float64]
    flags: NDArray[np.uint16]
    last_points_mm: NDArray[np.float64]
    last_range_mm: NDArray[np.float64]
    last_range_variance_mm2: NDArray[np.float64]
    last_response_mv: NDArray[np.float64]
    range_covariance_mm2: NDArray[np.float64]
    stretch: NDArray[np.float64] | None


def _ranged(angles_rad: NDArray[np.float64], ranges: Ranges, calibration: Calibration) -> _Ranged:
    """Put ranges into space along their beams."""
    true_rad, separation_mm = true_angles(angles_rad, calibration.scanner), calibration.mirror_separation_mm
    pointing_sd_rad = calibration.pointing_sd_rad
    return {
        "points_mm": points_from(true_rad, ranges.range_mm, separation_mm),
        "covariance_mm2": covariance_from(
            true_rad, ranges.range_mm, ranges.variance_mm2, pointing_sd_rad, separation_mm
        ),
        "range_mm": ranges.range_mm,
        "range_variance_mm2": ranges.variance_mm2,
        "response_mv": ranges.response_mv,
        "flags": ranges.flags,
        "last_points_mm": points_from(true_rad, ranges.last_range_mm, separation_mm),
        "last_range_mm": ranges.last_range_mm,
        "last_range_variance_mm2": ranges.last_variance_mm2,
        "last_response_mv": ranges.last_response_mv,
        "range_covariance_mm2": ranges.covariance_mm2,
        "stretch": _stretch(ranges),
    }


def _stretch(ranges: Ranges) -> NDArray[np.float64] | None:
    """Return stretch and variance (N, 2) where any echo tells them."""
    found = np.stack([ranges.stretch, ranges.stretch_variance], axis=1)
    return found if np.isfinite(found).any() else None
