"""`Station`: a warm radar, a stage before it, and a folder for the raw readings; what procedures measure with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.clock import Clock
from drivers.interfaces import Identity
from instrument.calibration import Calibration
from instrument.controller import Controller
from instrument.errors import Interrupted
from instrument.geometry import CENTRE_CODE, codes_to_angles
from instrument.procedures.stage import Stage
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
    ) -> None:
        self.controller = controller
        self.settings = settings
        self.calibration = calibration
        self.identities = identities
        self.stage = stage
        self.folder = folder
        self.progress = progress
        (folder / "raw").mkdir(exist_ok=True)

    @property
    def clock(self) -> Clock:
        """Get the bench's clock."""
        return self.controller.bench.clock

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

    def _take(self, name: str, job: RasterScan) -> Path:
        sampler = self.controller.bench.sampler
        header = job.header(self.identities, seed=None, zero_code=sampler.zero_code, mv_per_code=sampler.mv_per_code)
        path = self.folder / "raw" / f"{name}.db"
        with Recording.create(path, header) as recording:
            outcome = self.controller.scan(job, recording)
        if outcome.stop_reason != "complete":
            raise Interrupted(f"{outcome.stop_reason}; {outcome.safe}; the readings so far are in {path.parent}")
        return path


def cloud_of(path: Path) -> Cloud:
    """Read all places of a recording."""
    with Recording.open(path) as recording:
        return recording.cloud()


def traces_of(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Read the raw traces of a recording.

    Returns
    -------
    traces_mv : (N, S) float array
    times_ps : (S,) float array
    sweeps : int
    """
    with Recording.open(path) as recording:
        lines = list(recording.lines())
        traces = np.concatenate([recording.traces_mv(line) for line in lines])
        return traces, recording.times_ps, lines[0].sweeps
