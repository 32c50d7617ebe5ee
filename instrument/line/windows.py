"""`LineWindows`: the raw windows of a line as the sampling bridge has taken them (SBP 1.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.drivers.interfaces import WindowRecord

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
    start_fs, step_fs : (R, 2) int64 arrays
        First sampling instant after the trigger and step of each window, as the device was told, fs.
    samples, sweeps : (R, 2) int32 arrays
    sums : (T,) uint16 or uint32 array
        Sums of the A/D codes over the sweeps, window after window.
    """

    columns: NDArray[np.int32]
    retaken: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    start_fs: NDArray[np.int64]
    step_fs: NDArray[np.int64]
    samples: NDArray[np.int32]
    sweeps: NDArray[np.int32]
    sums: NDArray[np.unsignedinteger]

    @classmethod
    def of(
        cls, columns: ArrayLike, records: Sequence[WindowRecord], forms: Sequence[ArrayLike], *, retaken: bool
    ) -> Self:
        """Make one of the records of a run.

        Parameters
        ----------
        columns : (R,) array
        records : sequence of R WindowRecord
        forms : sequence of R (2, 2) arrays
            Start and step (fs) of both windows.
        retaken : bool
        """
        pieces = [[record.windows[k] for k in range(PULSES)] for record in records]
        form = np.asarray(forms, dtype=np.int64).reshape(len(pieces), PULSES, 2)
        sums = [piece.sums for pair in pieces for piece in pair]
        return cls(
            columns=np.asarray(columns, dtype=np.int32),
            retaken=np.full(len(pieces), retaken),
            clipped=np.array([any(piece.clipped for piece in pair) for pair in pieces], dtype=np.bool_),
            start_fs=form[:, :, 0],
            step_fs=form[:, :, 1],
            samples=np.array([[len(piece.sums) for piece in pair] for pair in pieces], dtype=np.int32),
            sweeps=np.array([[piece.sweeps for piece in pair] for pair in pieces], dtype=np.int32),
            sums=np.concatenate([np.empty(0, dtype=np.uint16), *sums]),
        )

    def __len__(self) -> int:
        return len(self.columns)

    def pieces(self) -> list[NDArray[np.unsignedinteger]]:
        """Return the sums of each of the 2 R windows."""
        return np.split(self.sums, np.cumsum(self.samples.ravel())[:-1]) if len(self) else []

    def where(self, chosen: NDArray[np.bool_]) -> Self:
        """Return the records of an (R,) mask."""
        kept = np.repeat(np.repeat(chosen, PULSES), self.samples.ravel())
        return replace(self, **{name: getattr(self, name)[chosen] for name in _PER_RECORD}, sums=self.sums[kept])

    def followed_by(self, later: Self) -> Self:
        """Return these records and then some later ones."""
        names = (*_PER_RECORD, "sums")
        return replace(self, **{name: np.concatenate([getattr(self, name), getattr(later, name)]) for name in names})


_PER_RECORD = ("columns", "retaken", "clipped", "start_fs", "step_fs", "samples", "sweeps")
