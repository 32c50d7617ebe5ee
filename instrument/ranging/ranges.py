"""`Ranges`: what ranging returns, and the speed of light that it uses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

AIR_INDEX = 1.00027  # group index of air at 904 nm, 20 degC, 1013 hPa
SPEED_OF_LIGHT_MM_PER_PS = 0.299792458 / AIR_INDEX
RANGE_PER_INTERVAL_MM_PER_PS = SPEED_OF_LIGHT_MM_PER_PS / 2  # there and back


@dataclass(frozen=True)
class PerRecord:
    """Base of dataclasses whose fields are all arrays with one entry a record."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Put several groups of records one after the other."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))

    def taken(self, records: NDArray[np.integer]) -> Self:
        """Return some of the records, in the order asked for."""
        return replace(self, **{one.name: getattr(self, one.name)[records] for one in fields(self)})


MAY_LACK = (
    *("last_range_mm", "last_variance_mm2", "last_response_mv", "covariance_mm2"),
    *("stretch", "stretch_variance"),
)
"""Values that not every way of ranging has."""


def _empty() -> NDArray[np.float64]:
    return np.empty(0)


@dataclass(frozen=True)
class Ranges(PerRecord):
    """Ranges of R records; every array is (R,).

    Attributes
    ----------
    range_mm : float array
        Range along the beam, walk corrected where a calibration was given; NaN without echo or reference.
    variance_mm2 : float array
        Variance that repeated readings have; NaN like the range.
    response_mv : float array
        Amplitude of the echo; NaN where there is none.
    flags : uint16 array
        Sums of `picoradar.instrument.line.scan_line.Flag`.
    bias_sd_mm : float array
        Standard deviation of the walk correction, which repeating does not reduce: a separate budget. 0 without
        calibration, NaN like the range.
    reference_ps : float array
        Time-significant point of the reference on the trace; NaN without reference.
    reference_mv : float array
        Amplitude of the reference; NaN without it.
    echo_ps : float array
        Time-significant point of the echo on the trace; NaN like the range.
    last_range_mm, last_variance_mm2, last_response_mv : float arrays
        Of the last echo where a record has two that are told apart, of which the range is the first; else NaN.
    covariance_mm2 : float array
        Covariance of the first and the last range; NaN where there is one.
    stretch, stretch_variance : float arrays
        How far light from inside the target stretches the echo, against the piece of its material that was measured
        (1; paint: 0), and its variance; NaN where that cannot be told or the calibration is for no material.
    """

    range_mm: NDArray[np.float64]
    variance_mm2: NDArray[np.float64]
    response_mv: NDArray[np.float64]
    flags: NDArray[np.uint16]
    bias_sd_mm: NDArray[np.float64]
    reference_ps: NDArray[np.float64]
    reference_mv: NDArray[np.float64]
    echo_ps: NDArray[np.float64]
    last_range_mm: NDArray[np.float64] = field(default_factory=_empty)
    last_variance_mm2: NDArray[np.float64] = field(default_factory=_empty)
    last_response_mv: NDArray[np.float64] = field(default_factory=_empty)
    covariance_mm2: NDArray[np.float64] = field(default_factory=_empty)
    stretch: NDArray[np.float64] = field(default_factory=_empty)
    stretch_variance: NDArray[np.float64] = field(default_factory=_empty)

    def __post_init__(self) -> None:
        """Say that no record has a last echo, or a stretch, where none was given."""
        for name in MAY_LACK:
            if len(getattr(self, name)) != len(self.flags):
                object.__setattr__(self, name, np.full(len(self.flags), np.nan))
