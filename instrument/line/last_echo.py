"""`LastEcho`: the last of two echoes of each place, which lines and clouds have alike."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

LAST_ECHO: dict[str, tuple[int, ...]] = {
    "last_points_mm": (3,),
    "last_range_mm": (),
    "last_range_variance_mm2": (),
    "last_response_mv": (),
    "range_covariance_mm2": (),
}
"""The arrays of a `LastEcho`, and the shape of each for one place."""


def _not_given() -> NDArray[np.float64]:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True)
class LastEcho:
    """Base of what has the last of two echoes for each of N places; NaN where there is one echo, or none.

    The range of a place is that of its first echo.

    Attributes
    ----------
    last_points_mm : (N, 3) float array
        Point of the last echo in the scanner frame, on the same beam as the first.
    last_range_mm, last_range_variance_mm2, last_response_mv : (N,) float arrays
        Its range along the beam (walk corrected; not for the stretch of echoes), the variance of it, and its amplitude.
    range_covariance_mm2 : (N,) float array
        Covariance of the first and the last range.
    """

    last_points_mm: NDArray[np.float64] = field(default_factory=_not_given)
    last_range_mm: NDArray[np.float64] = field(default_factory=_not_given)
    last_range_variance_mm2: NDArray[np.float64] = field(default_factory=_not_given)
    last_response_mv: NDArray[np.float64] = field(default_factory=_not_given)
    range_covariance_mm2: NDArray[np.float64] = field(default_factory=_not_given)

    @property
    def two_echoes(self) -> NDArray[np.bool_]:
        """Get the (N,) mask of places with two echoes that are told apart."""
        return np.asarray(np.isfinite(self.last_range_mm), dtype=np.bool_)

    def _one_echo_where_not_given(self, count: int) -> None:
        """Say that no place has a last echo where none was given: to be called by ``__post_init__``."""
        for name, shape in LAST_ECHO.items():
            if getattr(self, name).shape == (0,):
                object.__setattr__(self, name, np.full((count, *shape), np.nan))
