"""`Station`: a warm radar, a stage before it, and a folder for the raw readings; what procedures measure with."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Identity
from picoradar.instrument.acquisition import RasterScan
from picoradar.instrument.calibration import (
    CENTRE_CODE,
    Calibration,
    Method,
    angles_and_range,
    angles_to_codes,
    asked_angles,
)
from picoradar.instrument.controller import Controller
from picoradar.instrument.errors import Interrupted
from picoradar.instrument.procedures.station.light import LightMeters
from picoradar.instrument.procedures.station.places import PlacesScan, WatchScan
from picoradar.instrument.procedures.station.stage import Stage
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Settings, override

Progress = Callable[[float, str], None]
STARE_COLUMNS = 50


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
    seed : int, optional
        Of the simulated bench, for the recordings' headers.
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
        seed: int | None = None,
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
        self.seed = seed
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
        header = job.header(
            self.identities, seed=self.seed, zero_code=sampler.zero_code, mv_per_code=sampler.mv_per_code
        )
        path = self.folder / "raw" / f"{name}.db"
        with Recording.create(path, header) as recording:
            outcome = self.controller.scan(job, recording)
        if outcome.stop_reason != "complete":
            raise Interrupted(outcome.stop_reason)
        return path
