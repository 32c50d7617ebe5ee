"""A raster scan: beam to its place, record from the bridge, ranging, geometry, `ScanLine`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Galvo, Identity, Record, Sampler, SweepSettings
from picoradar.instrument.acquisition.motion import MotionWatch
from picoradar.instrument.acquisition.points import to_scan_line
from picoradar.instrument.acquisition.scan_raster import raster_of
from picoradar.instrument.calibration import Calibration, Method
from picoradar.instrument.controller import Between
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.ranging import Ranges, estimate, mark_footprint
from picoradar.instrument.settings import Settings

POINT_BYTES = 256  # of a place on the disk, without its trace


class RasterScan:
    """The raster of the settings in ``sweep`` mode: the whole trace at every place.

    Each place has a run id of its own (its number in the raster, from 1), so that a place measured again is known to
    be the same place, and a resumed scan goes on as an uninterrupted one would.

    Parameters
    ----------
    settings : Settings
    calibration : Calibration
        Range zero, walk, geometry.
    clock : Clock
        For the mirrors' settling.
    rows : sequence of int, optional
        Lines to take; all by default.

    Attributes
    ----------
    mode : str
        How it really scans.
    shots : int
        Laser shots sampled so far at the raster's places (without those that settle or watch for motion): divided by
        the PRF, the time that shots alone take.
    """

    mode = "sweep"

    def __init__(
        self, settings: Settings, calibration: Calibration, clock: Clock, rows: Sequence[int] | None = None
    ) -> None:
        self.settings = settings
        self.calibration = calibration
        self.clock = clock
        self.raster = raster_of(settings, calibration)
        self._rows = range(settings.scan.rows) if rows is None else rows
        self._reference: tuple[float, float | None] = (0.0, None)
        look_s, line_s = self._times_s()
        pointing_sd_mm = calibration.pointing_sd_rad * settings.scan.distance_mm
        self._watch = MotionWatch(settings.scan.rows, look_s, line_s, pointing_sd_mm)
        self._before: tuple[int, NDArray[np.float64]] | None = None  # row and ranges of the last line
        self.shots = 0

    @property
    def rows(self) -> Sequence[int]:
        """Get the rows to take, in order."""
        return self._rows

    @property
    def sweep(self) -> SweepSettings:
        """Get how one record is sampled."""
        sampler = self.settings.sampler
        return SweepSettings(
            start_ps=sampler.start_ps,
            step_ps=sampler.step_ps,
            samples=sampler.samples,
            averages=self.settings.scan.averages,
            settle_shots=sampler.settle_shots,
            prf_hz=self.settings.pulser.prf_hz,
        )

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler how records are taken."""
        sampler.configure(self.sweep)

    @property
    def line_bytes(self) -> int:
        """Get the most that one line takes on the disk (its traces not compressed)."""
        samples = self.settings.sampler.samples if self.settings.scan.keep_traces else 0
        return self.settings.scan.columns * (POINT_BYTES + 2 * samples)

    @property
    def reference(self) -> tuple[float, float | None]:
        """Get the lowest amplitude (mV) and median place (ps) of the reference in the last line; 0 and None: none."""
        return self._reference

    def header(
        self, identities: Mapping[str, Identity], *, seed: int | None, zero_code: float, mv_per_code: float
    ) -> dict[str, Any]:
        """Get the header of the recording: all that one must know to use or repeat the scan."""
        scan, sampler = self.settings.scan, self.settings.sampler
        raster = ("rows", "columns", "step_mm", "distance_mm", "mode", "averages", "estimator")
        return {
            "raster": {**{key: getattr(scan, key) for key in raster}, "mode": self.mode},
            "settings": self.settings.model_dump(),
            "seed": seed,
            "calibration": self.calibration.model_dump(mode="json"),
            "calibration_digest": self.calibration.digest,
            "scanner": {name: str(identity) for name, identity in identities.items()},
            "trace": {
                "start_ps": sampler.start_ps,
                "step_ps": sampler.step_ps,
                "samples": sampler.samples,
                "zero_code": zero_code,
                "mv_per_code": mv_per_code,
            },
        }

    def memory(self) -> dict[str, Any]:
        """Get what the next line needs to know of those before."""
        before = None if self._before is None else {"row": self._before[0], "range_mm": self._before[1].tolist()}
        return {"motion": self._watch.memory(), "before": before}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on from a `memory`."""
        if "motion" in memory:  # recordings of earlier versions have none
            self._watch.recall(memory["motion"])
        if before := memory.get("before"):
            self._before = before["row"], np.array(before["range_mm"], dtype=np.float64)

    def run_id(self, row: int, column: int) -> int:
        """Get the run id of a place: its number in the raster, from 1."""
        return row * self.settings.scan.columns + column + 1

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:
        """Take one line with the laser on.

        Parameters
        ----------
        row : int
        galvo, sampler
            Open and configured; the gate is open.
        between : callable
            Called before the line and before each place; what it raises ends the line.

        Raises
        ------
        DeviceError
        """
        plan = self.raster.line(row)
        began_s = self.clock.now()
        between()
        # Every line is approached in the same way, by the centre: where the beam was before leaves no trace in it.
        self._fly_to(plan.lead_in, galvo)
        records: list[Record] = []
        for column, (x_code, y_code) in zip(plan.columns, plan.codes, strict=True):
            between()
            galvo.move(int(x_code), int(y_code))
            self.clock.sleep(self.settings.scanner.settle_ms * 1e-3)
            records += sampler.take(self.run_id(row, int(column)))
        self.shots += len(records) * self.sweep.averages * self.sweep.samples
        ranges, sums = self._ranges_of(records, self.settings.scan.estimator)
        ranges = self._watched(row, self._mixed(row, ranges), self._look(row, galvo, sampler, between))
        kept = sums if self.settings.scan.keep_traces else None
        self._note_reference(ranges)
        return to_scan_line(
            row, plan.columns, plan.angles_rad, ranges, self.calibration,
            sums=kept, sweeps=records[0].sweeps, began_s=began_s,
        )  # fmt: skip

    def _fly_to(self, codes: NDArray[np.int64], galvo: Galvo) -> None:
        for x_code, y_code in ((galvo.codes // 2, galvo.codes // 2), codes):
            galvo.move(int(x_code), int(y_code))
            self.clock.sleep(self.settings.scanner.flyback_settle_ms * 1e-3)

    def _look(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> Ranges | None:
        """Measure the place that is watched, if it is its turn; as a run of its own after those of the raster."""
        if self._watch.place is None or not self._watch.due:
            return None
        between()
        watched_row, column = self._watch.place
        self._fly_to(self.raster.line(watched_row).codes[column], galvo)
        records = sampler.take(self.run_id(self.settings.scan.rows + row, 0))
        # The template tells smaller motions; how the scan itself is ranged makes no difference to this.
        found, _ = self._ranges_of(list(records), "template" if self.calibration.templates else "half-maximum")
        return found

    def _mixed(self, row: int, ranges: Ranges) -> Ranges:
        """Flag places whose spot does not lie on one surface, as far as this line and the one before show it."""
        before_mm = self._before[1] if self._before is not None and self._before[0] == row - 1 else None
        self._before = row, ranges.range_mm
        return mark_footprint(ranges, self.settings.scan.step_mm, before_mm)

    def _watched(self, row: int, ranges: Ranges, look: Ranges | None) -> Ranges:
        """Take the look at the watched place in, and flag the line if the target has moved."""
        self._watch.line_done(row, ranges, self.settings.scan.step_mm, look)
        if not self._watch.moved:
            return ranges
        return replace(ranges, flags=ranges.flags | np.uint16(Flag.MOTION))

    def _times_s(self) -> tuple[float, float]:
        """Get how long a look at the watched place takes, and a line."""
        scanner, sweep = self.settings.scanner, self.sweep
        record_s = sweep.averages * (sweep.settle_shots + sweep.samples) / sweep.prf_hz
        fly_s = 2e-3 * scanner.flyback_settle_ms
        return fly_s + record_s, fly_s + self.settings.scan.columns * (scanner.settle_ms * 1e-3 + record_s)

    def _ranges_of(self, records: Sequence[Record], method: Method) -> tuple[Ranges, NDArray[np.unsignedinteger]]:
        first = records[0]
        sums = np.stack([record.sums for record in records])
        ranges = estimate(
            (sums / first.sweeps - first.zero_code) * first.mv_per_code,
            first.times_ps,
            method=method,
            calibration=self.calibration,
            sweeps=first.sweeps,
            clipped=np.array([record.clipped for record in records]),
        )
        return ranges, sums

    def _note_reference(self, ranges: Ranges) -> None:
        there = np.isfinite(ranges.reference_mv)
        if 2 * np.count_nonzero(there) >= len(there):
            self._reference = float(ranges.reference_mv[there].min()), float(np.median(ranges.reference_ps[there]))
        else:
            self._reference = (0.0, None)
