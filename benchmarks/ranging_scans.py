"""Whole scans of the simulated bench, through drivers and firmware: how long they take and how good they are."""

from __future__ import annotations

import logging
import resource
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import structlog
from numpy.typing import NDArray

from picoradar.instrument.acquisition import Stop, plan_path, point_windows_of
from picoradar.instrument.cli import scanning, session
from picoradar.instrument.cli.simulated import Simulated
from picoradar.instrument.line import SUSPECT, Flag
from picoradar.instrument.ranging import PointWindows
from picoradar.instrument.recording import Cloud, Recording
from picoradar.instrument.settings import Settings

FloatArray = NDArray[np.float64]

FASTER_HZ = 240e3


@dataclass(frozen=True)
class Taken:
    """A scan: what the command says of it, its points, their true ranges (N,), and the windows line by line."""

    result: dict[str, Any]
    cloud: Cloud
    true_mm: FloatArray
    lines: list[list[PointWindows]]

    @property
    def good(self) -> NDArray[np.bool_]:
        """Get the (N,) mask of points without a flag that casts doubt on them, whose true range is known."""
        flagged = (self.cloud.flags & np.uint16(SUSPECT)) != 0
        return self.cloud.has_range & ~flagged & np.isfinite(self.true_mm)

    def __str__(self) -> str:
        good, cloud, result = self.good, self.cloud, self.result
        error = (cloud.range_mm - self.true_mm)[good]
        chi2 = float(np.mean(error**2 / cloud.range_variance_mm2[good]))
        device_s, shots_s = result["device_time_s"], result["shot_limited_s"]
        suspect = 100 * np.count_nonzero(cloud.flags & np.uint16(SUSPECT)) / len(cloud)
        return (
            f"{device_s:8.2f} {device_s / shots_s:6.2f} {result['points']:6d} {suspect:6.2f} "
            f"{np.sqrt(np.mean(error**2)):7.3f} {error.mean():7.3f} {np.abs(error).max():6.2f} {chi2:5.2f}"
        )


def scan(seed: int, target: str, mode: str, size: int = 40, *, windows_too: bool = True, **simulation: object) -> Taken:
    """Take a scan of size x size points at 1 mm as picoradar comes, with changes of the simulation."""
    settings = Settings.model_validate(
        {
            "seed": seed,
            "scan": {"mode": mode, "rows": size, "columns": size},
            "simulation": {"target": target, **simulation},
        }
    )
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))
    with tempfile.TemporaryDirectory() as folder, session.session(settings, None) as run:
        path = Path(folder) / "scan.db"
        session.warm_up(run)
        result, _, cloud = scanning.record_scan(run, path)
        with Recording.open(path) as recording:
            raw = [line.windows for line in recording.lines()] if windows_too and mode == "window" else []
        simulated = run.simulated
        if not isinstance(simulated, Simulated):
            raise TypeError("the settings name no simulated bench")
        true_mm = simulated.bench.truth.ranges_mm(*_runs_of(cloud, mode, size))
    return Taken(result, cloud, true_mm, [point_windows_of(windows) for windows in raw if windows is not None])


def _runs_of(cloud: Cloud, mode: str, size: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return run id and record number of each point, as `SweepCapture` and `WindowCapture` number them."""
    rows, columns = cloud.rows.astype(np.int64), cloud.columns.astype(np.int64)
    if mode == "sweep":
        return rows * size + columns + 1, np.zeros_like(rows)
    retaken = (cloud.flags & np.uint16(Flag.RETAKEN)) != 0
    before = np.cumsum(retaken) - np.cumsum(retaken)[np.searchsorted(rows, rows)] + retaken[np.searchsorted(rows, rows)]
    return np.where(retaken, size, 0) + rows + 1, np.where(retaken, before - 1, columns)


def reckoned_s(lines: Sequence[Sequence[PointWindows]], settings: Settings, prf_hz: float) -> float:
    """Reckon how long the same windows would take at another rate: paths, rests of the mirrors, and their sending."""
    scanner, total_s = settings.scanner, 0.0
    settle_s, blank = scanner.window_settle_ms * 1e-3, np.zeros(2, dtype=np.int64)
    for points in lines:
        stops = [
            Stop(
                blank,
                max(0.0, settle_s - point.reference.shots(scanner.window_settle_shots) / prf_hz),
                point.shots(scanner.window_settle_shots) / prf_hz,
            )
            for point in points
        ]
        path = plan_path(blank, scanner.window_flyback_ms * 1e-3, stops)
        total_s += len(path.codes) / path.rate_hz + SENDING_S
    return total_s


SENDING_S = 9.5e-3  # planning's telegrams and the path on its way to the galvo controller, as at 80 kHz


def windows(seed: int, scans: int, sweeps: int) -> None:
    """Print a line for each scan of hip and prism, and what share of sweep mode's points window mode gets."""
    print("target seed mode    device s  /shots points flag %  rms mm bias mm  max mm chi^2 (points without a flag)")
    for target in ("hip", "prism"):
        for number in range(scans):
            window = scan(seed + number, target, "window")
            print(f"{target:6} {seed + number:4d} window {window}", flush=True)
            if number < sweeps:
                sweep = scan(seed + number, target, "sweep")
                print(f"{target:6} {seed + number:4d} sweep  {sweep}", flush=True)
                had = sweep.cloud.has_range
                share = 100 * np.count_nonzero(window.cloud.has_range & had) / np.count_nonzero(had)
                print(f"            {share:.2f} % of the points of sweep mode are there in window mode")
        settings = Settings()
        for prf_hz in (settings.pulser.prf_hz, FASTER_HZ):
            told_s = reckoned_s(window.lines, settings, prf_hz)
            print(f"            the windows of the last one, reckoned at {prf_hz / 1e3:g} kHz: {told_s:.2f} s")


def memory(mode: str) -> None:
    """Print the most memory that this process has had after scans of growing size.

    The simulated bench keeps the truth of every record (0.6 kB), which a real one does not.
    """
    for size in (40, 60, 80, 110):
        taken = scan(1, "hip", mode, size, windows_too=False)
        most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{mode} {size} x {size}: {taken.result['points']} points, at most {most_mb:.0f} MB", flush=True)
