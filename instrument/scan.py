"""A raster scan: beam to its place, record from the bridge, ranging, geometry, `ScanLine`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.clock import Clock
from drivers.interfaces import Galvo, Identity, Record, Sampler, SweepSettings
from instrument.calibration import Calibration
from instrument.controller import Between
from instrument.errors import BadInput
from instrument.geometry import covariance_from, points_from, true_angles
from instrument.ranging import Ranges, estimate
from instrument.raster import LinePlan, Raster
from instrument.scan_line import ScanLine
from instrument.settings import Settings

BYTES_PER_SAMPLE = 64  # of a line in memory: codes, the trace in mV and what ranging needs beside it
MOST_LINE_BYTES = 1_000_000_000
POINT_BYTES = 256  # of a place on the disk, without its trace


def raster_of(settings: Settings, calibration: Calibration) -> Raster:
    """Lay the raster of the settings out for a calibrated scanner.

    Raises
    ------
    LimitError
        When it does not fit into the scanner's span.
    BadInput
        When one of its lines does not fit into memory.
    """
    _refuse_enormous_lines(settings)
    scan = settings.scan
    return Raster(
        rows=scan.rows,
        columns=scan.columns,
        step_mm=scan.step_mm,
        distance_mm=scan.distance_mm,
        field_deg=settings.scanner.field_deg,
        separation_mm=calibration.mirror_separation_mm,
        errors=calibration.scanner,
    )


def _refuse_enormous_lines(settings: Settings) -> None:
    """Refuse lines whose traces do not fit into memory while they are ranged, with the number.

    Raises
    ------
    BadInput
    """
    columns, samples = settings.scan.columns, settings.sampler.samples
    needed = columns * samples * BYTES_PER_SAMPLE
    if needed > MOST_LINE_BYTES:
        raise BadInput(
            f"a line of {columns} places with {samples} samples each needs about {needed / 1e9:.1f} GB of memory "
            f"to be ranged, more than {MOST_LINE_BYTES / 1e9:.0f} GB; take fewer columns or samples"
        )


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
        Laser shots sampled so far (settling shots not counted): divided by the PRF, the time that shots alone take.
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
        """Get what the next line needs to know of those before: nothing in whole sweeps."""
        return {}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on from a `memory`: nothing to do in whole sweeps."""

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
        scanner = self.settings.scanner
        between()
        # Every line is approached in the same way, by the centre: where the beam was before leaves no trace in it.
        for x_code, y_code in ((galvo.codes // 2, galvo.codes // 2), plan.lead_in):
            galvo.move(int(x_code), int(y_code))
            self.clock.sleep(scanner.flyback_settle_ms * 1e-3)
        records: list[Record] = []
        for column, (x_code, y_code) in zip(plan.columns, plan.codes, strict=True):
            between()
            galvo.move(int(x_code), int(y_code))
            self.clock.sleep(scanner.settle_ms * 1e-3)
            records += sampler.take(self.run_id(row, int(column)))
        self.shots += len(records) * self.sweep.averages * self.sweep.samples
        return self._line(plan, records, began_s)

    def _line(self, plan: LinePlan, records: Sequence[Record], began_s: float) -> ScanLine:
        first = records[0]
        sums = np.stack([record.sums for record in records])
        ranges = estimate(
            (sums / first.sweeps - first.zero_code) * first.mv_per_code,
            first.times_ps,
            method=self.settings.scan.estimator,
            calibration=self.calibration,
            sweeps=first.sweeps,
            clipped=np.array([record.clipped for record in records]),
        )
        return self._scan_line(plan, ranges, sums if self.settings.scan.keep_traces else None, first.sweeps, began_s)

    def _scan_line(
        self,
        plan: LinePlan,
        ranges: Ranges,
        sums: NDArray[np.unsignedinteger] | None,
        sweeps: int,
        began_s: float,
    ) -> ScanLine:
        """Put ranges into space, and note how the reference was."""
        there = np.isfinite(ranges.reference_mv)
        if 2 * np.count_nonzero(there) >= len(there):
            self._reference = float(ranges.reference_mv[there].min()), float(np.median(ranges.reference_ps[there]))
        else:
            self._reference = (0.0, None)
        return to_scan_line(
            plan.row,
            plan.columns,
            plan.angles_rad,
            ranges,
            self.calibration,
            sums=sums,
            sweeps=sweeps,
            began_s=began_s,
        )


def to_scan_line(
    row: int,
    columns: NDArray[np.int32],
    angles_rad: NDArray[np.float64],
    ranges: Ranges,
    calibration: Calibration,
    *,
    sums: NDArray[np.unsignedinteger] | None,
    sweeps: int,
    began_s: float,
) -> ScanLine:
    """Put the ranges of a line into space.

    Parameters
    ----------
    row : int
    columns : (N,) int array
    angles_rad : (N, 2) float array
        Optical angles as asked for; the scanner's errors of the calibration are applied.
    ranges : Ranges
        Of N places.
    calibration : Calibration
    sums : (N, S) array or None
        Raw traces to keep.
    sweeps : int
    began_s : float
        Device time at which the line was begun.
    """
    true_rad = true_angles(angles_rad, calibration.scanner)
    separation_mm = calibration.mirror_separation_mm
    return ScanLine(
        index=row,
        columns=columns,
        angles_rad=angles_rad,
        points_mm=points_from(true_rad, ranges.range_mm, separation_mm),
        covariance_mm2=covariance_from(
            true_rad, ranges.range_mm, ranges.variance_mm2, calibration.pointing_sd_rad, separation_mm
        ),
        range_mm=ranges.range_mm,
        range_variance_mm2=ranges.variance_mm2,
        response_mv=ranges.response_mv,
        flags=ranges.flags,
        sums=sums,
        sweeps=sweeps,
        device_time_s=began_s,
    )
