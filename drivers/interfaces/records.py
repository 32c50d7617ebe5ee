"""Records: how they are sampled, and what a sampler returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import CodeScale, Trace


@dataclass(frozen=True)
class SweepSettings:
    """How one record is sampled.

    Attributes
    ----------
    start_ps, step_ps : float
        Sampling instant of the first sample after the trigger, and step from shot to shot.
    samples : int
        Samples in a sweep, one laser shot each.
    averages : int
        Sweeps added into one record.
    settle_shots : int
        Shots discarded before each sweep.
    prf_hz : float
        Rate of the external trigger.
    """

    start_ps: float
    step_ps: float
    samples: int
    averages: int
    settle_shots: int
    prf_hz: float

    @property
    def times_ps(self) -> NDArray[np.float64]:
        """Get the (S,) sampling instants that this asks for; a device rounds them to its own grid."""
        return np.asarray(self.start_ps + self.step_ps * np.arange(self.samples), dtype=np.float64)

    @property
    def record_s(self) -> float:
        """Get how long one record takes (s): averages x (settle + samples) / PRF."""
        return self.averages * (self.settle_shots + self.samples) / self.prf_hz


@dataclass(frozen=True)
class Record:
    """One averaged trace.

    Attributes
    ----------
    run_id, number : int
        Run that it belongs to, and its number in that run.
    sums : (S,) uint16 or uint32 array
        Sum of the A/D codes over the sweeps, as the device sent it.
    sweeps : int
        Sweeps in the sum.
    times_ps : (S,) float array
        Sampling instants after the trigger, ps.
    zero_code, mv_per_code : float
        A/D code of 0 V, and size of a code.
    clipped, trigger_lost : bool
        Reported by the device: a sample was clipped, triggers were missing.
    device_time_us : int
        Start of the record, counted from the start of the run.
    """

    run_id: int
    number: int
    sums: NDArray[np.unsignedinteger]
    sweeps: int
    times_ps: NDArray[np.float64]
    zero_code: float
    mv_per_code: float
    clipped: bool
    trigger_lost: bool
    device_time_us: int

    @property
    def trace(self) -> Trace:
        """Get codes, scale and instants alone, as they go on to ranging."""
        return Trace(self.sums, self.sweeps, self.times_ps, CodeScale(self.zero_code, self.mv_per_code))

    @property
    def trace_mv(self) -> NDArray[np.float64]:
        """Get the (S,) mean trace at the photodiode bridge, in mV."""
        return self.trace.mv


@dataclass(frozen=True)
class WindowRecord:
    """One record taken in windows.

    Attributes
    ----------
    number : int
        Number in the run.
    windows : tuple of Record
        One averaged piece of the trace for each window, in the order of the window table.
    """

    number: int
    windows: tuple[Record, ...]
