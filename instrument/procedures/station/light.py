"""Light at other working points than that of the settings: a job for the controller that measures the laser itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Galvo, Record, Sampler, SweepSettings
from picoradar.instrument.controller import Between
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import ScanLine, ZeroReading

FloatArray = NDArray[np.float64]
Wait = Callable[[Callable[[], bool]], None]
POLL_S = 0.5  # from one poll of the interlocks to the next while a meter is read with the laser on
CURRENT_SWEEP = SweepSettings(  # 12 ns, as figure 2.7
    start_ps=0.0, step_ps=10.0, samples=1200, averages=64, settle_shots=0, prf_hz=20_000.0
)
SWEEP = SweepSettings(start_ps=3000.0, step_ps=2.5, samples=1400, averages=64, settle_shots=0, prf_hz=20_000.0)


class LightMeters(Protocol):
    """A fast photodetector and the laser's current on an oscilloscope, and a power meter at the exit."""

    def open(self) -> None:
        """Open the oscilloscope."""

    def close(self) -> None:
        """Close it."""

    def trace(self, sweep: SweepSettings) -> Record:
        """Take one averaged trace of the laser pulse."""

    def current(self, sweep: SweepSettings) -> tuple[Record, float] | None:
        """Take one averaged trace of the current pulse, and its mV for each ampere; None where it is not wired."""

    def mean_power_mw(self, where: str, wait: Wait) -> float:
        """Read the power meter at the working point ``where``; ``wait`` lets time pass until a condition holds."""


@dataclass(frozen=True)
class Light:
    """What the meters saw: trace (S,) in mV less its zero, times (S,) in ps, mean power.

    Where it was asked for and is wired, also the laser's current (T,) in A at its own times (T,) in ps.
    """

    trace_mv: FloatArray
    times_ps: FloatArray
    mean_power_mw: float
    current_a: FloatArray | None = None
    current_times_ps: FloatArray | None = None


class LightJob:
    """One line without points: with the laser on, one trace and one reading of the power; and the current if asked."""

    def __init__(
        self, meters: LightMeters, sweep: SweepSettings, where: str, clock: Clock, *, with_current: bool = False
    ) -> None:
        self._meters = meters
        self._sweep = sweep
        self._where = where
        self._clock = clock
        self._with_current = with_current
        self.light: Light | None = None

    @property
    def rows(self) -> Sequence[int]:
        """Get the rows to take."""
        return (0,)

    @property
    def line_bytes(self) -> int:
        """Get what a line takes on the disk: a row of the report's table."""
        return 100

    @property
    def reference(self) -> tuple[float, float | None]:
        """Get the reference: the job does not measure it, and calls it ordinary lest the laser be stopped."""
        return ORDINARY_REFERENCE_MV, None

    def state_dict(self) -> JsonObject:
        """Get what the next line needs to know: nothing."""
        return {}

    def goes_on_at(self, row: int) -> bool:  # noqa: ARG002 - as for a scan
        """Get whether the scan goes on after a stop: never."""
        return False

    def run_up(self, row: int) -> Sequence[int]:  # noqa: ARG002
        """Get the rows to take again before a row: none."""
        return ()

    def recall(self, row: int) -> JsonObject:  # noqa: ARG002
        """Get what was recorded before a row: nothing."""
        return {}

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler, which keeps the gate, how records would be taken."""
        sampler.configure(self._gate_sweep)

    @property
    def _gate_sweep(self) -> SweepSettings:
        return SweepSettings(6500.0, 6.7, 1430, 1, 0, self._sweep.prf_hz)

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:  # noqa: ARG002
        """Read the meters."""
        between()
        record = self._meters.trace(self._sweep)

        def wait(until: Callable[[], bool]) -> None:
            while not self._clock.wait(until, POLL_S):
                between()

        power_mw = self._meters.mean_power_mw(self._where, wait)
        between()
        asked = replace(CURRENT_SWEEP, prf_hz=self._sweep.prf_hz)
        seen = self._meters.current(asked) if self._with_current else None
        current = () if seen is None else (seen[0].trace.mv / seen[1], np.asarray(seen[0].times_ps))
        self.light = Light(record.trace.mv, np.asarray(record.times_ps), power_mw, *current)
        nothing = np.empty(0)
        return ScanLine(
            index=row,
            columns=np.empty(0, dtype=np.int32),
            angles_rad=np.empty((0, 2)),
            points_mm=np.empty((0, 3)),
            covariance_mm2=np.empty((0, 3, 3)),
            range_mm=nothing,
            range_variance_mm2=nothing,
            response_mv=nothing,
            flags=np.empty(0, dtype=np.uint16),
            traces=None,
            sweeps=1,
            device_time_s=float(record.device_time_us) * 1e-6,
        )


ORDINARY_REFERENCE_MV = 40.0


class NoStore:
    """A store for lines without points: events are in the log, the readings in the report's table."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "raw"

    def append(self, line: ScanLine, *, acknowledged_at_s: float | None = None) -> None:
        """Take a line; there is nothing in it."""

    def append_zero(self, reading: ZeroReading) -> None:
        """Take a reading of the mark; there is none."""

    def event(self, time_s: float, kind: str, *, state: str | None = None, **fields: object) -> None:
        """Take note of nothing."""

    def finish(self, stop_reason: str, *, laser_off_verified: bool, **summary: object) -> bool:  # noqa: ARG002
        """Close."""
        return True
