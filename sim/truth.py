"""`BenchTruth`: what the simulated bench knows and the code under test must not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.optics import Optics


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

    def ranges_mm(self, run_ids: NDArray[np.int64]) -> NDArray[np.float64]:
        """Get the true ranges (N,) in mm of the last record of each run; NaN where nothing was hit or nothing taken."""
        last = {key[0]: truth.range_mm for key, truth in self._optics.truth.items()}
        ranges = np.array([last.get(int(run_id), np.nan) for run_id in run_ids], dtype=np.float64)
        return np.where(np.isfinite(ranges), ranges, np.nan)
