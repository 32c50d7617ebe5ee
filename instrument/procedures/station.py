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
from drivers.interfaces import Identity
from instrument.calibration import Calibration, Method
from instrument.controller import Controller
from instrument.errors import Interrupted
from instrument.geometry import CENTRE_CODE, codes_to_angles, points_from, true_angles
from instrument.procedures.stage import Stage
from instrument.ranging import estimate
from instrument.raster import LinePlan
from instrument.recording import Cloud, Recording
from instrument.scan import RasterScan
from instrument.settings import Settings, override

Progress = Callable[[float, str], None]
STARE_COLUMNS = 50


class StareScan(RasterScan):
    """The same place again and again: the raster's lines hold one place as often as they have columns."""

    def __init__(self, settings: Settings, calibration: Calibration, clock: Clock, codes: tuple[int, int]) -> None:
        super().__init__(settings, calibration, clock)
        self.raster = _Stare(settings, codes)  # type: ignore[assignment]


class _Stare:
    """A raster without extent."""

    def __init__(self, settings: Settings, codes: tuple[int, int]) -> None:
        self._columns = settings.scan.columns
        self._field_deg = settings.scanner.field_deg
        self._codes = np.array(codes, dtype=np.int64)

    def line(self, row: int) -> LinePlan:
        """Return the plan of one line."""
        codes = np.tile(self._codes, (self._columns, 1))
        return LinePlan(
            row=row,
            columns=np.arange(self._columns, dtype=np.int32),
            lead_in=self._codes,
            codes=codes,
            angles_rad=codes_to_angles(codes, self._field_deg),
        )


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
    ) -> None:
        self.controller = controller
        self.settings = settings
        self.calibration = calibration
        self.identities = identities
        self.stage = stage
        self.folder = folder
        self.progress = progress
        self.date = datetime.datetime.now(datetime.UTC) if date is None else date
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
        place = codes or (CENTRE_CODE, CENTRE_CODE)
        return self._take(name, StareScan(settings, self.calibration, self.clock, place))

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

    def stamped(self, calibration: Calibration, provenance: str, **changes: Any) -> Calibration:
        """Return a calibration with new values and with date, provenance and instrument of this run."""
        numbers = {name: one.serial_number for name, one in self.identities.items() if one.serial_number}
        return calibration.model_copy(
            update={
                "date": self.date,
                "provenance": provenance,
                "serial_numbers": numbers,
                "diode_degc": self.settings.diode.target_degc,
                **changes,
            }
        )

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
