"""`Station`: a warm radar, a stage before it, and a folder for the raw readings; what procedures measure with."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.drivers.traces import CodeScale
from picoradar.instrument.acquisition import Acquisition, Setup, can_window, monitor_scan, points_scan, raster_scan
from picoradar.instrument.calibration import (
    CENTRE_CODE,
    Calibration,
    Method,
    angles_and_range,
    angles_to_codes,
    asked_angles,
)
from picoradar.instrument.controller import Controller, Subscription
from picoradar.instrument.errors import Interrupted
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import ScanLine
from picoradar.instrument.procedures.station.light import LightMeters
from picoradar.instrument.procedures.station.measured import Measured
from picoradar.instrument.procedures.station.radar import Radar
from picoradar.instrument.procedures.station.stage import Stage
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Settings, override

Progress = Callable[[float, str], None]
DWELL_COLUMNS = 50


class Station:
    """Measures for the procedures; every measurement leaves a recording in the report folder.

    Parameters
    ----------
    radar : Radar
    stage : Stage
    folder : Path
        Report folder; recordings go to ``raw``.
    progress : callable
        Called with (share done 0..1, what is going on).
    date : datetime.datetime, optional
        Date that a new calibration carries; now by default.
    meters : LightMeters, optional
        Oscilloscope and power meter at the laser, where there are some.
    """

    def __init__(
        self,
        radar: Radar,
        stage: Stage,
        folder: Path,
        progress: Progress,
        *,
        date: datetime.datetime | None = None,
        meters: LightMeters | None = None,
    ) -> None:
        self._radar = radar
        self.stage = stage
        self.folder = folder
        self.progress = progress
        self.date = datetime.datetime.now(datetime.UTC) if date is None else date
        self.meters = meters
        (folder / "raw").mkdir(exist_ok=True)

    @property
    def controller(self) -> Controller:
        """Get the controller, in state ``ready``."""
        return self._radar.controller

    @property
    def settings(self) -> Settings:
        """Get the settings in force."""
        return self._radar.settings

    @property
    def calibration(self) -> Calibration:
        """Get the calibration in force while measuring."""
        return self._radar.calibration

    @property
    def clock(self) -> Clock:
        """Get the bench's clock."""
        return self._radar.clock

    @property
    def best_method(self) -> Method:
        """Get the better estimator of those that the calibration allows."""
        return "template" if self.calibration.templates is not None else "half-maximum"

    def dwell(
        self, name: str, readings: int, *, averages: int | None = None, codes: tuple[int, int] | None = None
    ) -> Measured:
        """Take readings at one fixed point (by default straight ahead).

        Raises
        ------
        Interrupted
            When a person stopped it.
        """
        columns = min(readings, DWELL_COLUMNS)
        rows = -(-readings // columns)
        point = np.array(codes or (CENTRE_CODE, CENTRE_CODE), dtype=np.int64)
        return self._take(name, points_scan(self._setup(averages=averages), np.broadcast_to(point, (rows, columns, 2))))

    def aim(self, name: str, points_mm: NDArray[np.float64], *, averages: int | None = None) -> Measured:
        """Send the beam to each of some measurement points (rows, columns, 3) in mm.

        Raises
        ------
        LimitError
            When a point is outside the scanner's span.
        Interrupted
            When a person stopped it.
        """
        rows, columns, _ = points_mm.shape
        setup = self._setup(averages=averages)
        wanted, _ = angles_and_range(points_mm.reshape(-1, 3), self.calibration.mirror_separation_mm)
        asked = asked_angles(wanted, self.calibration.scanner)
        codes = angles_to_codes(asked, setup.settings.scanner.field_deg).reshape(rows, columns, 2)
        return self._take(name, points_scan(setup, codes))

    @property
    def has_windows(self) -> bool:
        """Get whether the devices can take records in windows."""
        bench = self.controller.bench
        return can_window(bench.galvo, bench.sampler)

    def scan(
        self,
        name: str,
        *,
        rows: int,
        columns: int,
        step_mm: float,
        distance_mm: float,
        averages: int | None = None,
        in_windows: bool = False,
    ) -> Measured:
        """Scan a raster; in windows only where the devices have them (`has_windows`).

        Raises
        ------
        Interrupted
            When a person stopped it.
        """
        changes = {"rows": rows, "columns": columns, "step_mm": step_mm, "distance_mm": distance_mm}
        return self._take(name, raster_scan(self._setup(**changes, averages=averages), in_windows=in_windows))

    def monitor(self, name: str, groups: int, readings: int, interval_s: float) -> Measured:
        """Take groups of readings straight ahead, one after each interval with the laser on.

        Raises
        ------
        Interrupted
            When a person stopped it.
        """
        centre = np.full((groups, readings, 2), CENTRE_CODE, dtype=np.int64)
        return self._take(name, monitor_scan(self._setup(), centre, interval_s))

    def stamped(self, calibration: Calibration, provenance: str, **changes: Any) -> Calibration:
        """Return a calibration with new values and with date, provenance and instrument of this run."""
        numbers = {name: one.serial_number for name, one in self._radar.identities.items() if one.serial_number}
        stamp = {
            "date": self.date,
            "provenance": provenance,
            "serial_numbers": numbers,
            "diode_degc": self.settings.diode.target_degc,
        }
        # A copy would keep the digest of the one it was made from, and would not be checked.
        return Calibration.model_validate(calibration.model_copy(update={**stamp, **changes}).model_dump())

    def _setup(self, **scan: float | None) -> Setup:
        """Return what an acquisition goes by, with some settings of the scan replaced; traces are always kept, and
        nothing is taken off the ranges for a material."""
        changes: JsonObject = {**scan, "keep_traces": True, "material": ""}
        return Setup(override(self.settings, {"scan": changes}), self.calibration, self.clock)

    def _take(self, name: str, job: Acquisition) -> Measured:
        sampler, radar = self.controller.bench.sampler, self._radar
        scale = CodeScale(sampler.zero_code, sampler.mv_per_code)
        path = self.folder / "raw" / f"{name}.db"
        lines: list[ScanLine] = []
        with Recording.create(path, job.header(radar.identities, seed=radar.seed, scale=scale)) as recording:
            outcome = self.controller.scan(job, recording, [Subscription(lines.append, every_line=True)])
        if outcome.stop_reason != "complete":
            raise Interrupted(outcome.stop_reason)
        return Measured(path, tuple(lines))
