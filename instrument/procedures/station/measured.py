"""`Measured`: what one measurement of a procedure gave, ready to be ranged in several ways."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import Trace
from picoradar.instrument.calibration import Calibration, Method, points_from, true_angles
from picoradar.instrument.line import ScanLine
from picoradar.instrument.ranging import Ranges, estimate
from picoradar.instrument.recording import Cloud, cloud_of


@dataclass(frozen=True)
class Measured:
    """The lines of one measurement, with their raw traces.

    Attributes
    ----------
    recording : Path
        Where the same lines are recorded.
    lines : tuple of ScanLine
    """

    recording: Path
    lines: tuple[ScanLine, ...]

    @cached_property
    def cloud(self) -> Cloud:
        """Get all its N points, with the ranges of the acquisition."""
        return cloud_of(self.lines)

    @cached_property
    def trace(self) -> Trace:
        """Get the raw traces (N, S) of all its points.

        Raises
        ------
        ValueError
            When the lines carry none.
        """
        traces = [line.traces for line in self.lines if line.traces is not None]
        if len(traces) != len(self.lines):
            raise ValueError(f"{self.recording}: lines without raw traces cannot be ranged by a procedure")
        return replace(traces[0], sums=np.concatenate([trace.sums for trace in traces]))

    @property
    def began_s(self) -> NDArray[np.float64]:
        """Get the (N,) times of the bench's clock at which the line of each point was begun."""
        return np.repeat([line.device_time_s for line in self.lines], [len(line.columns) for line in self.lines])

    def ranges(self, method: Method, calibration: Calibration) -> Ranges:
        """Range the N raw traces by an estimator and a calibration."""
        trace = self.trace
        return estimate(trace.mv, trace.times_ps, method=method, calibration=calibration, sweeps=trace.sweeps)

    def reprocessed(self, method: Method, calibration: Calibration) -> Cloud:
        """Return the N points as an estimator and a calibration have them; covariances are those of the acquisition."""
        found = self.ranges(method, calibration)
        angles = true_angles(self.cloud.angles_rad, calibration.scanner)
        return replace(
            self.cloud,
            points_mm=points_from(angles, found.range_mm, calibration.mirror_separation_mm),
            range_mm=found.range_mm,
            range_variance_mm2=found.variance_mm2,
            response_mv=found.response_mv,
            flags=found.flags,
            last_points_mm=points_from(angles, found.last_range_mm, calibration.mirror_separation_mm),
            last_range_mm=found.last_range_mm,
            last_range_variance_mm2=found.last_variance_mm2,
            last_response_mv=found.last_response_mv,
            range_covariance_mm2=found.covariance_mm2,
        )
