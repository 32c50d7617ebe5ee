"""`Station`: a warm radar, a stage before it, and a folder for the raw readings; what procedures measure with."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.clock import Clock
from drivers.interfaces import Galvo, Identity, Sampler
from instrument.calibration import Calibration, Method
from instrument.controller import Between, Controller
from instrument.errors import Interrupted
from instrument.geometry import (
    CENTRE_CODE,
    angles_and_range,
    angles_to_codes,
    asked_angles,
    codes_to_angles,
    points_from,
    true_angles,
)
from instrument.procedures.light import LightMeters
from instrument.procedures.stage import Stage
from instrument.ranging import estimate
from instrument.raster import LinePlan
from instrument.recording import Cloud, Recording
from instrument.scan import RasterScan
from instrument.scan_line import ScanLine
from instrument.settings import Settings, override

Progress = Callable[[float, str], None]
STARE_COLUMNS = 50
WATCH_LOOK_S = 10.0  # from one look at the interlocks to the next while waiting with the laser on


class PlacesScan(RasterScan):
    """Any places instead of a raster: ``codes`` (rows, columns, 2) of the scanner; lines begin at their first place."""

    def __init__(self, settings: Settings, calibration: Calibration, clock: Clock, codes: NDArray[np.int64]) -> None:
        super().__init__(override(settings, {"scan": {"step_mm": 0.01}}), calibration, clock)
        self._codes = codes
        self.raster = self  # type: ignore[assignment]

    def line(self, row: int) -> LinePlan:
        """Return the plan of one line."""
        codes = self._codes[row]
        return LinePlan(
            row=row,
            columns=np.arange(len(codes), dtype=np.int32),
            lead_in=codes[0],
            codes=codes,
            angles_rad=codes_to_angles(codes, self.settings.scanner.field_deg),
        )


class WatchScan(PlacesScan):
    """Lines at intervals (s) with the laser on all the time; run ids go on as if records had been taken throughout."""

    def __init__(
        self,
        settings: Settings,
        calibration: Calibration,
        clock: Clock,
        codes: NDArray[np.int64],
        interval_s: float,
    ) -> None:
        super().__init__(settings, calibration, clock, codes)
        self._interval_s = interval_s
        record_s = self.sweep.averages * (self.sweep.samples + self.sweep.settle_shots) / self.sweep.prf_hz
        self._records_a_line = max(int(interval_s / record_s), int(codes.shape[1]))
        self._next_s = clock.now()

    def run_id(self, row: int, column: int) -> int:
        """Get the run id of a place."""
        return row * self._records_a_line + column + 1

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:
        """Wait for the line's time, then take it; looks at the interlocks meanwhile."""
        if row > 0:
            while (left_s := self._next_s - self.clock.now()) > 0:
                between()
                self.clock.sleep(min(left_s, WATCH_LOOK_S))
        else:
            self._next_s = self.clock.now()
        self._next_s += self._interval_s
        return super().take_line(row, galvo, sampler, between)


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


class Station:
    """Measures for the procedures; every measurement leaves a recording in the report folder.

    Parameters
    ----------
    controller : Controller
        Connected and warm (state ``ready``).
    settings : Settings
    calibration : Calibration
        In force while measuring.
    identities : mapping
        Who answered, for the recordings' headers.
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
        controller: Controller,
        settings: Settings,
        calibration: Calibration,
        identities: Mapping[str, Identity],
        stage: Stage,
        folder: Path,
        progress: Progress,
        date: datetime.datetime | None = None,
        meters: LightMeters | None = None,
    ) -> None:
        self.controller = controller
        self.settings = settings
        self.calibration = calibration
        self.identities = identities
        self.stage = stage
        self.folder = folder
        self.progress = progress
        self.date = datetime.datetime.now(datetime.UTC) if date is None else date
        self.meters = meters
        (folder / "raw").mkdir(exist_ok=True)

    @property
    def clock(self) -> Clock:
        """Get the bench's clock."""
        return self.controller.bench.clock

    @property
    def best_method(self) -> Method:
        """Get the better estimator of those that the calibration allows."""
        return "template" if self.calibration.templates is not None else "half-maximum"

    def stare(
        self, name: str, readings: int, *, averages: int | None = None, codes: tuple[int, int] | None = None
    ) -> Path:
        """Take readings at one place (by default straight ahead) and return the recording.

        Raises
        ------
        Interrupted
            When a person stopped it.
        """
        columns = min(readings, STARE_COLUMNS)
        rows = -(-readings // columns)
        settings = override(self.settings, {"scan": {"rows": rows, "columns": columns, "averages": averages}})
        place = np.array(codes or (CENTRE_CODE, CENTRE_CODE), dtype=np.int64)
        every = np.broadcast_to(place, (rows, columns, 2))
        return self._take(name, PlacesScan(settings, self.calibration, self.clock, every))

    def aim(self, name: str, places_mm: NDArray[np.float64], *, averages: int | None = None) -> Path:
        """Send the beam to each of some places (rows, columns, 3) in mm and return the recording.

        Raises
        ------
        LimitError
            When a place is outside the scanner's span.
        Interrupted
            When a person stopped it.
        """
        rows, columns, _ = places_mm.shape
        settings = override(self.settings, {"scan": {"rows": rows, "columns": columns, "averages": averages}})
        wanted, _ = angles_and_range(places_mm.reshape(-1, 3), self.calibration.mirror_separation_mm)
        asked = asked_angles(wanted, self.calibration.scanner)
        codes = angles_to_codes(asked, settings.scanner.field_deg).reshape(rows, columns, 2)
        return self._take(name, PlacesScan(settings, self.calibration, self.clock, codes))

    def scan(
        self, name: str, *, rows: int, columns: int, step_mm: float, distance_mm: float, averages: int | None = None
    ) -> Path:
        """Scan a raster and return the recording.

        Raises
        ------
        Interrupted
            When a person stopped it.
        """
        changes = {"rows": rows, "columns": columns, "step_mm": step_mm, "distance_mm": distance_mm}
        settings = override(self.settings, {"scan": {**changes, "averages": averages}})
        return self._take(name, RasterScan(settings, self.calibration, self.clock))

    def watch(self, name: str, groups: int, readings: int, interval_s: float) -> Path:
        """Take groups of readings straight ahead, one after each interval with the laser on; return the recording.

        Raises
        ------
        Interrupted
            When a person stopped it.
        """
        settings = override(self.settings, {"scan": {"rows": groups, "columns": readings, "averages": None}})
        centre = np.full((groups, readings, 2), CENTRE_CODE, dtype=np.int64)
        return self._take(name, WatchScan(settings, self.calibration, self.clock, centre, interval_s))

    def stamped(self, calibration: Calibration, provenance: str, **changes: Any) -> Calibration:
        """Return a calibration with new values and with date, provenance and instrument of this run."""
        numbers = {name: one.serial_number for name, one in self.identities.items() if one.serial_number}
        stamp = {
            "date": self.date,
            "provenance": provenance,
            "serial_numbers": numbers,
            "diode_degc": self.settings.diode.target_degc,
        }
        # A copy would keep the digest of the one it was made from, and would not be checked.
        return Calibration.model_validate(calibration.model_copy(update={**stamp, **changes}).model_dump())

    def _take(self, name: str, job: RasterScan) -> Path:
        sampler = self.controller.bench.sampler
        header = job.header(self.identities, seed=None, zero_code=sampler.zero_code, mv_per_code=sampler.mv_per_code)
        path = self.folder / "raw" / f"{name}.db"
        with Recording.create(path, header) as recording:
            outcome = self.controller.scan(job, recording)
        if outcome.stop_reason != "complete":
            raise Interrupted(f"{outcome.stop_reason}; {outcome.safe}; the readings so far are in {path.parent}")
        return path


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
