"""The acquisitions that there are: which plan goes with which capture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.acquisition.acquisition import Acquisition
from picoradar.instrument.acquisition.capture import Setup
from picoradar.instrument.acquisition.points import MonitorPlan, PointsPlan
from picoradar.instrument.acquisition.raster import RasterPlan
from picoradar.instrument.acquisition.sweep import SweepCapture, sweep_of
from picoradar.instrument.acquisition.window import WindowCapture
from picoradar.instrument.acquisition.zero_mark import MarkPlan


def raster_scan(
    setup: Setup, rows: Sequence[int] | None = None, *, in_windows: bool = False, mark: MarkPlan | None = None
) -> Acquisition:
    """Make the scan of the raster of the settings.

    Parameters
    ----------
    setup : Setup
    rows : sequence of int, optional
        Lines to take; all by default.
    in_windows : bool
        By `WindowCapture` instead of `SweepCapture`; the devices must have windows (`can_window`).
    mark : MarkPlan, optional
        The mark that the range zero is checked by, before the first line and after the last.

    Raises
    ------
    LimitError
        When the raster does not fit into the scanner's span.
    BadInput
        When a line does not fit into memory, or the calibration lacks what windows need.
    """
    plan = RasterPlan.of(setup.settings, setup.calibration)
    capture = WindowCapture(setup, plan.columns) if in_windows else SweepCapture(setup)
    return Acquisition(plan, capture, setup, rows, mark)


def points_scan(setup: Setup, codes: NDArray[np.int64]) -> Acquisition:
    """Make the acquisition of any measurement points: codes (rows, columns, 2) of the scanner, whole traces."""
    return Acquisition(PointsPlan(codes, setup.settings.scanner.field_deg), SweepCapture(setup), setup)


def monitor_scan(setup: Setup, codes: NDArray[np.int64], interval_s: float) -> Acquisition:
    """Make the acquisition of lines of measurement points (rows, columns, 2), one after each interval."""
    points = PointsPlan(codes, setup.settings.scanner.field_deg)
    plan = MonitorPlan(points, interval_s, sweep_of(setup.settings).record_s, setup.clock)
    return Acquisition(plan, SweepCapture(setup), setup)
