"""`LineWindows`: the raw windows of a line as the sampling bridge has taken them (SBP 1.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.drivers.interfaces import WindowRecord
from picoradar.drivers.traces import CodeScale, Window

PULSES = 2  # windows of a record: over the reference, over the echo


@dataclass(frozen=True)
class LineWindows:
    """R records of two windows each, first the one over the reference; in the order in which they were taken.

    Attributes
    ----------
    columns : (R,) int32 array
        Raster column of each record. One that was taken again has two records, the second one `retaken`.
    retaken, clipped : (R,) bool arrays
        Taken again with a wide window; the device has seen a sample at an end of its A/D.
    start_ps, step_ps : (R, 2) float arrays
        First sampling instant after the trigger and step of each window.
    samples, sweeps : (R, 2) int32 arrays
    sums : (T,) uint16 or uint32 array
        Sums of the A/D codes over the sweeps, window after window.
    scale : CodeScale
    """

    columns: NDArray[np.int32]
    retaken: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    start_ps: NDArray[np.float64]
    step_ps: NDArray[np.float64]
    samples: NDArray[np.int32]
    sweeps: NDArray[np.int32]
    sums: NDArray[np.unsignedinteger]
    scale: CodeScale

    @classmethod
    def of(
        cls, columns: ArrayLike, records: Sequence[WindowRecord], table: Sequence[Sequence[Window]], *, retaken: bool
    ) -> Self:
        """Make one of the records of a run.

        Parameters
        ----------
        columns : (R,) array
        records : sequence of R WindowRecord, at least one
        table : sequence of R pairs of Window
            Both windows of each record as they were asked for, in whole femtoseconds.
        retaken : bool
        """
        pieces = [[record.windows[k] for k in range(PULSES)] for record in records]
        form = np.array([[(window.start_ps, window.step_ps) for window in pair] for pair in table], dtype=np.float64)
        sums = [piece.sums for pair in pieces for piece in pair]
        return cls(
            columns=np.asarray(columns, dtype=np.int32),
            retaken=np.full(len(pieces), retaken),
            clipped=np.array([any(piece.clipped for piece in pair) for pair in pieces], dtype=np.bool_),
            start_ps=form[:, :, 0],
            step_ps=form[:, :, 1],
            samples=np.array([[len(piece.sums) for piece in pair] for pair in pieces], dtype=np.int32),
            sweeps=np.array([[piece.sweeps for piece in pair] for pair in pieces], dtype=np.int32),
            sums=np.concatenate([np.empty(0, dtype=np.uint16), *sums]),
            scale=pieces[0][0].trace.scale,
        )

    def __len__(self) -> int:
        return len(self.columns)

    def traces_mv(self) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return the mean traces of the two windows of each of the R records, in mV at the photodiode."""
        pieces = np.split(self.sums, np.cumsum(self.samples.ravel())[:-1]) if len(self) else []
        traces = [
            self.scale.to_mv(sums, sweeps) for sums, sweeps in zip(pieces, self.sweeps.ravel().tolist(), strict=True)
        ]
        return list(zip(traces[::PULSES], traces[1::PULSES], strict=True))

    def table(self) -> list[tuple[Window, Window]]:
        """Return the two windows of each of the R records."""
        columns = (getattr(self, name).ravel().tolist() for name in ("start_ps", "step_ps", "samples", "sweeps"))
        windows = [Window(*form) for form in zip(*columns, strict=True)]
        return list(zip(windows[::PULSES], windows[1::PULSES], strict=True))

    def where(self, chosen: NDArray[np.bool_]) -> Self:
        """Return the records of an (R,) mask."""
        kept = np.repeat(np.repeat(chosen, PULSES), self.samples.ravel())
        return replace(self, **{name: getattr(self, name)[chosen] for name in _PER_RECORD}, sums=self.sums[kept])

    def followed_by(self, later: Self) -> Self:
        """Return these records and then some later ones."""
        names = (*_PER_RECORD, "sums")
        arrays: dict[str, Any] = {name: np.concatenate([getattr(self, name), getattr(later, name)]) for name in names}
        return replace(self, **arrays)


_PER_RECORD = ("columns", "retaken", "clipped", "start_ps", "step_ps", "samples", "sweeps")
