"""`Trace`: averaged samples as the A/D gave them, with scale and instants; `Window`: which piece of it to take.

A trace goes through all rooms as it was received, and becomes mV in one place, `CodeScale.to_mv`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class CodeScale:
    """Scale of the A/D: ``zero_code``, the code of 0 V, and ``mv_per_code``, mV at the photodiode for each code."""

    zero_code: float
    mv_per_code: float

    def to_mv(self, sums: NDArray[np.unsignedinteger], sweeps: int) -> NDArray[np.float64]:
        """Return the mean of ``sweeps`` sweeps in mV at the photodiode.

        Parameters
        ----------
        sums : (..., S) uint16 or uint32 array
            Sums of the A/D codes over the sweeps.
        sweeps : int
        """
        return np.asarray((sums / float(sweeps) - self.zero_code) * self.mv_per_code, dtype=np.float64)


@dataclass(frozen=True)
class Trace:
    """One averaged trace, or the N traces of a line.

    Attributes
    ----------
    sums : (S,) or (N, S) uint16 or uint32 array
        Sums of the A/D codes over the sweeps.
    sweeps : int
        Sweeps in each sum.
    times_ps : (S,) float array
        Sampling instants after the trigger.
    scale : CodeScale
    """

    sums: NDArray[np.unsignedinteger]
    sweeps: int
    times_ps: NDArray[np.float64]
    scale: CodeScale

    @property
    def mv(self) -> NDArray[np.float64]:
        """Get the mean traces at the photodiode, in mV; the shape is that of `sums`."""
        return self.scale.to_mv(self.sums, self.sweeps)

    @classmethod
    def stacked(cls, traces: Sequence[Trace]) -> Self:
        """Put N single traces of equal form together, (N, S)."""
        first = traces[0]
        return cls(np.stack([trace.sums for trace in traces]), first.sweeps, first.times_ps, first.scale)


@dataclass(frozen=True)
class Window:
    """A piece of the trace and its number of sweeps; the protocol's whole femtoseconds are the wire's business.

    Attributes
    ----------
    start_ps, step_ps : float
        First sampling instant after the trigger, and step.
    samples, sweeps : int
    """

    start_ps: float
    step_ps: float
    samples: int
    sweeps: int

    def shots(self, settle_shots: int) -> int:
        """Get the laser shots that it takes: sweeps x (settle + samples)."""
        return self.sweeps * (settle_shots + self.samples)

    @property
    def end_ps(self) -> float:
        """Get the last sampling instant."""
        return self.start_ps + self.step_ps * (self.samples - 1)
