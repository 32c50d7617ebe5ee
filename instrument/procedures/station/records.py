"""What procedures read back from their recordings: raw traces, and clouds ranged anew."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, Method, points_from, true_angles
from picoradar.instrument.ranging import estimate
from picoradar.instrument.recording import Cloud, Recording


@dataclass(frozen=True)
class Records:
    """Raw traces of a recording.

    Attributes
    ----------
    traces_mv : (N, S) float array
    times_ps : (S,) float array
    sweeps : int
    began_s : (N,) float array
        Time of the bench's clock at which the line of each record began.
    """

    traces_mv: NDArray[np.float64]
    times_ps: NDArray[np.float64]
    sweeps: int
    began_s: NDArray[np.float64]


def cloud_of(path: Path, method: Method | None = None, calibration: Calibration | None = None) -> Cloud:
    """Read all places of a recording.

    Parameters
    ----------
    path : Path
    method : str, optional
        Range the raw traces again with this estimator; by default the ranges are those of the scan.
    calibration : Calibration, optional
        With this calibration; needed with ``method``.
    """
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    return cloud if method is None else ranged_again(cloud, traces_of(path), method, calibration)


def ranged_again(cloud: Cloud, records: Records, method: Method, calibration: Calibration | None) -> Cloud:
    """Return a cloud with its ranges and points made anew from the raw traces."""
    if calibration is None:
        raise ValueError("ranging again needs a calibration")
    found = estimate(records.traces_mv, records.times_ps, method=method, calibration=calibration, sweeps=records.sweeps)
    angles = true_angles(cloud.angles_rad, calibration.scanner)
    return replace(
        cloud,
        points_mm=points_from(angles, found.range_mm, calibration.mirror_separation_mm),
        range_mm=found.range_mm,
        range_variance_mm2=found.variance_mm2,
        response_mv=found.response_mv,
        flags=found.flags,
    )


def traces_of(path: Path) -> Records:
    """Read the raw traces of a recording."""
    with Recording.open(path) as recording:
        lines = list(recording.lines())
        return Records(
            traces_mv=np.concatenate([recording.traces_mv(line) for line in lines]),
            times_ps=recording.times_ps,
            sweeps=lines[0].sweeps,
            began_s=np.repeat([line.device_time_s for line in lines], [len(line.columns) for line in lines]),
        )
