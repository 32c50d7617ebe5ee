"""`BenchTruth`: the truth of the simulated bench, hidden from the code under test."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics import Optics


class BenchTruth:
    """Hidden truth of a simulated bench, for reports and tests.

    Parameters
    ----------
    optics : Optics
        The physics that knows it.
    """

    def __init__(self, optics: Optics) -> None:
        self._optics = optics

    @property
    def scanner_from_model(self) -> NDArray[np.float64]:
        """Get the true pose (4, 4) of the target."""
        return self._optics.scanner_from_model

    @property
    def model_from_scanner(self) -> NDArray[np.float64]:
        """Get the inverse of that pose (4, 4)."""
        return np.asarray(np.linalg.inv(self._optics.scanner_from_model), dtype=np.float64)

    def ranges_mm(self, run_ids: NDArray[np.int64], records: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """Get the true ranges (N,) in mm of records of runs; NaN where nothing was hit or nothing taken.

        Parameters
        ----------
        run_ids, records : (N,) int arrays
            Which run, and which record in it (0 by default). Of a run taken several times the last one counts.
        """
        numbers = np.zeros(len(run_ids), dtype=np.int64) if records is None else records
        last = {(run, record): truth.range_mm for (run, _, record), truth in self._optics.truth.items()}
        wanted = zip(run_ids.tolist(), numbers.tolist(), strict=True)
        ranges = np.array([last.get(key, np.nan) for key in wanted], dtype=np.float64)
        return np.where(np.isfinite(ranges), ranges, np.nan)
