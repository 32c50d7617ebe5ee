"""`SweepCapture`: the whole trace at every point, one record after the other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.interfaces import Galvo, Record, Sampler, SweepSettings
from picoradar.drivers.traces import Trace
from picoradar.instrument.acquisition.capture import Captured, Devices, MarkRecords, Revisit, Setup
from picoradar.instrument.acquisition.plan import LinePlan, Plan
from picoradar.instrument.acquisition.zero_mark import MarkPlan
from picoradar.instrument.calibration import METHODS, Method, Ranging
from picoradar.instrument.events import JsonObject
from picoradar.instrument.ranging import Ranges, estimate
from picoradar.instrument.settings import Settings

MARK_SWEEPS = 16
"""Sweeps that the zero mark is measured with at least: noise of less than 0.2 mm, so that an error of 2 mm shows."""


class SweepCapture:
    """Mode ``sweep``: beam to its point, mirrors settle, one record.

    Each point has a run id of its own, so that a point measured again is known to be the same point, and a resumed
    scan goes on as an uninterrupted one would.

    Parameters
    ----------
    setup : Setup
    """

    mode = "sweep"

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._scanner = setup.settings.scanner
        self._calibrations = {method: setup.calibration_for(method) for method in METHODS}
        self.sweep = sweep_of(setup.settings)

    @property
    def estimator(self) -> Method:
        """Get the estimator of the settings."""
        return self._setup.settings.scan.estimator

    @property
    def ranging(self) -> Ranging:
        """Get the estimator: it ranges whole traces."""
        return self.estimator

    @property
    def raw_bytes(self) -> int:
        """Get the most that a trace takes on the disk."""
        return 2 * self.sweep.samples

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler how records are taken."""
        sampler.configure(self.sweep)

    def times_s(self, columns: int) -> tuple[float, float]:
        """Get how long a revisit takes, and a line."""
        sweep = self.sweep
        record_s = sweep.averages * (sweep.settle_shots + sweep.samples) / sweep.prf_hz
        fly_s = 2e-3 * self._scanner.flyback_settle_ms
        return fly_s + record_s, fly_s + columns * (self._scanner.settle_ms * 1e-3 + record_s)

    @property
    def memory_s(self) -> float:
        """Get for how long a motion of the mirrors before a line shows in it: every line comes by the centre."""
        return 0.0

    def take(self, plan: Plan, line: LinePlan, revisit: Revisit | None, devices: Devices) -> Captured:
        """Take a line point by point; the revisit is a run of its own after those of the plan."""
        devices.between()
        # Every line is approached in the same way, by the centre: where the beam was before leaves no trace in it.
        self._fly_to(line.lead_in, devices.galvo)
        records: list[Record] = []
        for column, (x_code, y_code) in zip(line.columns, line.codes, strict=True):
            devices.between()
            devices.galvo.move(int(x_code), int(y_code))
            self._setup.clock.sleep(self._scanner.settle_ms * 1e-3)
            records += devices.sampler.take(plan.run_id(line.row, int(column)))
        trace = Trace.stacked([record.trace for record in records])
        repeat_id = plan.run_id(plan.rows + line.row, 0)
        return Captured(
            ranges=self._ranges_of(trace, records, self.estimator),
            sweeps=trace.sweeps,
            shots=len(records) * self.sweep.averages * self.sweep.samples,
            revisit=None if revisit is None else self._revisited(repeat_id, revisit, devices),
            # With the instants that the header names, so that a line in memory is the line that is read back; the
            # device's own differ from them by its rounding.
            traces=replace(trace, times_ps=self.sweep.times_ps),
        )

    def take_mark(self, run_id: int, mark: MarkPlan, devices: Devices) -> MarkRecords:
        """Take whole traces of the zero mark: one record, or as many as have `MARK_SWEEPS` sweeps together."""
        devices.between()
        self._fly_to(mark.codes, devices.galvo)
        records: list[Record] = []
        for number in range(math.ceil(MARK_SWEEPS / self.sweep.averages)):
            devices.between()
            records += devices.sampler.take(run_id + number)
        traces = replace(Trace.stacked([record.trace for record in records]), times_ps=self.sweep.times_ps)
        return MarkRecords(traces, None, np.array([record.clipped for record in records]))

    def state_dict(self) -> JsonObject:
        """Get what the next line needs to know of those before: nothing."""
        return {}

    def load_state(self, state: JsonObject) -> None:
        """Do nothing: no line depends on those before."""

    def _fly_to(self, codes: NDArray[np.int64], galvo: Galvo) -> None:
        for x_code, y_code in ((galvo.codes // 2, galvo.codes // 2), codes):
            galvo.move(int(x_code), int(y_code))
            self._setup.clock.sleep(self._scanner.flyback_settle_ms * 1e-3)

    def _revisited(self, run_id: int, revisit: Revisit, devices: Devices) -> Ranges:
        devices.between()
        self._fly_to(revisit.codes, devices.galvo)
        records = devices.sampler.take(run_id)
        # The template tells smaller motions; how the scan itself is ranged makes no difference to this.
        method: Method = "template" if self._setup.calibration.templates else "half-maximum"
        return self._ranges_of(Trace.stacked([record.trace for record in records]), records, method)

    def _ranges_of(self, trace: Trace, records: list[Record], method: Method) -> Ranges:
        return estimate(
            trace.mv,
            trace.times_ps,
            method=method,
            calibration=self._calibrations[method],
            sweeps=trace.sweeps,
            clipped=np.array([record.clipped for record in records]),
        )


def sweep_of(settings: Settings) -> SweepSettings:
    """Return how one record is sampled by the settings."""
    sampler = settings.sampler
    return SweepSettings(
        start_ps=sampler.start_ps,
        step_ps=sampler.step_ps,
        samples=sampler.samples,
        averages=settings.scan.averages,
        settle_shots=sampler.settle_shots,
        prf_hz=settings.pulser.prf_hz,
    )
