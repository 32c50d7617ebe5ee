"""`WindowTraces`: the samples of one window, of many records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.settings import RangingSettings

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class WindowTraces:
    """One window of R records, all of the same length and step.

    Attributes
    ----------
    values_mv : (R, M) float array
        Mean traces.
    first_ps : (R,) float array
        Sampling instant of the first sample.
    step_ps : float
    sweeps : (R,) float array
    """

    values_mv: FloatArray
    first_ps: FloatArray
    step_ps: float
    sweeps: FloatArray

    @classmethod
    def of(cls, values_mv: ArrayLike, first_ps: ArrayLike, step_ps: float, sweeps: ArrayLike = 1) -> WindowTraces:
        """Make one of what can be broadcast to it.

        Raises
        ------
        BadInput
            When the shapes do not fit, or a window has fewer than 12 samples.
        """
        values = np.asarray(values_mv, dtype=np.float64)
        if values.ndim != 2 or values.shape[1] < RangingSettings.min_window_samples or not step_ps > 0:
            raise BadInput(
                f"a window needs (R, M >= {RangingSettings.min_window_samples}) samples and a positive step, "
                f"not shape {values.shape} and {step_ps:g} ps"
            )
        try:
            first = np.broadcast_to(np.asarray(first_ps, dtype=np.float64), (len(values),))
            counts = np.broadcast_to(np.asarray(sweeps, dtype=np.float64), (len(values),))
        except ValueError as error:
            raise BadInput(f"first_ps and sweeps must be one value or {len(values)} values: {error}") from error
        if len(values) and not counts.min() >= 1:
            raise BadInput(f"sweeps must be at least 1, not {counts.min():g}")
        return cls(values, first, float(step_ps), counts)

    def part(self, records: slice) -> WindowTraces:
        """Return some of the records."""
        return WindowTraces(self.values_mv[records], self.first_ps[records], self.step_ps, self.sweeps[records])
