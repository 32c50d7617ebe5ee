"""Ranges put into space: `to_scan_line` for a line just taken, `reprocessed` for one ranged before."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

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
    ranges = captured.ranges
    placed = _in_space(plan.angles_rad, ranges, calibration)
    return ScanLine(
        index=plan.row,
        columns=plan.columns,
        angles_rad=plan.angles_rad,
        points_mm=placed.points_mm,
        covariance_mm2=placed.covariance_mm2,
        range_mm=ranges.range_mm,
        range_variance_mm2=ranges.variance_mm2,
        response_mv=ranges.response_mv,
        flags=ranges.flags,
        traces=captured.traces,
        sweeps=captured.sweeps,
        device_time_s=began_s,
        windows=captured.windows,
        last_points_mm=placed.last_points_mm,
        last_range_mm=ranges.last_range_mm,
        last_range_variance_mm2=ranges.last_variance_mm2,
        last_response_mv=ranges.last_response_mv,
        range_covariance_mm2=ranges.covariance_mm2,
        stretch=_stretch(ranges),
    )


def reprocessed(line: ScanLine, ranges: Ranges, calibration: Calibration) -> ScanLine:
    """Return a line with other ranges (N,) of its points, by a calibration that may be another one, too."""
    placed = _in_space(line.angles_rad, ranges, calibration)
    return replace(
        line,
        points_mm=placed.points_mm,
        covariance_mm2=placed.covariance_mm2,
        range_mm=ranges.range_mm,
        range_variance_mm2=ranges.variance_mm2,
        response_mv=ranges.response_mv,
        flags=ranges.flags,
        last_points_mm=placed.last_points_mm,
        last_range_mm=ranges.last_range_mm,
        last_range_variance_mm2=ranges.last_variance_mm2,
        last_response_mv=ranges.last_response_mv,
        range_covariance_mm2=ranges.covariance_mm2,
        stretch=_stretch(ranges),
    )


def _stretch(ranges: Ranges) -> NDArray[np.float64] | None:
    """Return stretch and variance (N, 2) where any echo tells them."""
    found = np.stack([ranges.stretch, ranges.stretch_variance], axis=1)
    return found if np.isfinite(found).any() else None


class _InSpace(NamedTuple):
    """Points (N, 3) mm in the scanner frame, their covariances (N, 3, 3) mm^2, and the points of the last echoes."""

    points_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float64]
    last_points_mm: NDArray[np.float64]


def _in_space(angles_rad: NDArray[np.float64], ranges: Ranges, calibration: Calibration) -> _InSpace:
    true_rad = true_angles(angles_rad, calibration.scanner)
    separation_mm = calibration.mirror_separation_mm
    return _InSpace(
        points_from(true_rad, ranges.range_mm, separation_mm),
        covariance_from(true_rad, ranges.range_mm, ranges.variance_mm2, calibration.pointing_sd_rad, separation_mm),
        points_from(true_rad, ranges.last_range_mm, separation_mm),
    )
