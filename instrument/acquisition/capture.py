"""`Capture`: how the points of a line are sampled and ranged. One class a way: `SweepCapture`, `WindowCapture`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Galvo, Sampler
from picoradar.drivers.traces import Trace
from picoradar.instrument.acquisition.plan import LinePlan, Plan
from picoradar.instrument.acquisition.zero_mark import MarkPlan
from picoradar.instrument.calibration import Calibration, Method, Ranging
from picoradar.instrument.controller import Between
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import LineWindows
from picoradar.instrument.ranging import Ranges
from picoradar.instrument.settings import Settings


@dataclass(frozen=True)
class Setup:
    """What an acquisition goes by: settings and calibration in force, and the bench's clock."""

    settings: Settings
    calibration: Calibration
    clock: Clock

    def calibration_for(self, ranging: Ranging) -> Calibration:
        """Return the calibration that ranges the material of the settings in this way, without its bias."""
        return self.calibration.for_material(self.settings.scan.material, ranging)


class Devices(NamedTuple):
    """Open and configured, the gate is open; ``between`` is called before each step and may raise."""

    galvo: Galvo
    sampler: Sampler
    between: Between


@dataclass(frozen=True)
class Revisit:
    """A point that was measured before and is measured again: ``codes`` (x, y), and where its echo was on the trace
    (ps) with which response (mV)."""

    codes: NDArray[np.int64]
    echo_ps: float
    response_mv: float


@dataclass(frozen=True)
class Captured:
    """The points of one line.

    Attributes
    ----------
    ranges : Ranges
        Of N points.
    sweeps : int
        In a record, at most.
    shots : int
        Laser shots sampled at the line's points, without those that settle and without the revisit.
    revisit : Ranges or None
        Of the one record of the revisited point, if it was asked for.
    traces : Trace or None
        Raw (N, S), of a capture of whole traces.
    windows : LineWindows or None
        Raw, of a capture in windows.
    """

    ranges: Ranges
    sweeps: int
    shots: int
    revisit: Ranges | None = None
    traces: Trace | None = None
    windows: LineWindows | None = None


MARK_RUNS = 100
"""Run ids that each measurement of the zero mark may use."""


class MarkRecords(NamedTuple):
    """Raw records of the zero mark: ``traces`` (R, S) or ``windows`` of R records, and which were ``clipped`` (R,)."""

    traces: Trace | None
    windows: LineWindows | None
    clipped: NDArray[np.bool_]


class Capture(Protocol):
    """Takes one line; knows nothing of where the points lie."""

    @property
    def mode(self) -> str:
        """Get the mode's name in settings and recordings."""

    @property
    def estimator(self) -> Method:
        """Get the method that ranges are estimated by."""

    @property
    def ranging(self) -> Ranging:
        """Get the way of ranging that a material's bias belongs to."""

    @property
    def raw_bytes(self) -> int:
        """Get the most that the raw samples of a point take on the disk (not compressed)."""

    @property
    def memory_s(self) -> float:
        """Get for how long a motion of the mirrors before a line shows in it; 0 when it does not."""

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler how records are taken."""

    def times_s(self, columns: int) -> tuple[float, float]:
        """Get how long a revisit takes, and a line of so many points at least."""

    def take(self, plan: Plan, line: LinePlan, revisit: Revisit | None, devices: Devices) -> Captured:
        """Take a line of the plan, and the revisit at its end if there is one.

        Raises
        ------
        DeviceError
        """

    def take_mark(self, run_id: int, mark: MarkPlan, devices: Devices) -> MarkRecords:
        """Take the records of the zero mark, of runs from ``run_id`` on, fewer than `MARK_RUNS`.

        Raises
        ------
        DeviceError
        """

    def state_dict(self) -> JsonObject:
        """Get what the next line needs to know of those before, as plain data."""

    def load_state(self, state: JsonObject) -> None:
        """Go on from a `state_dict`."""
