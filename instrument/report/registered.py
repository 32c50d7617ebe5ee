"""`RegisteredScan`: what a report needs to know of a registration beside the scan itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from picoradar.registration import Registration, Tolerance


class Surface(NamedTuple):
    """Triangles of a model: vertices (V, 3) mm and faces (F, 3)."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


@dataclass(frozen=True)
class RegisteredScan:
    """A registration of exactly the points with a range, in the order of the recording.

    Attributes
    ----------
    registration : Registration
    tolerance : Tolerance
        That its verdict was drawn by.
    model : Surface or None
        Without it there is no overlay.
    truth_error : mapping or None
        On a simulated bench: ``rotation_deg``, ``translation_mm``, ``tre_mm``, and ``at_targets_mm``, the largest of
        any target.
    """

    registration: Registration
    tolerance: Tolerance
    model: Surface | None = None
    truth_error: Mapping[str, float] | None = None

    @property
    def stated_mm(self) -> float:
        """Get the largest error that is stated at a target; NaN where a common range error was never measured."""
        return max((target.stated_mm for target in self.registration.targets), default=math.nan)

    @property
    def beyond_stated(self) -> bool:
        """Get whether the true pose is known, and a target is farther off than was stated."""
        return self.truth_error is not None and self.truth_error.get("at_targets_mm", 0.0) > self.stated_mm

    @property
    def known_wrong(self) -> bool:
        """Get whether the true pose is known, and its error is beyond what was stated or beyond the tolerance.

        A caution that states its error promises no more than that: the tolerance is then not its limit.
        """
        error = self.truth_error
        if error is None:
            return False
        within = error["rotation_deg"] <= self.tolerance.rotation_deg
        within &= error["translation_mm"] <= self.tolerance.target_mm
        said = self.registration.verdict == "caution" and math.isfinite(self.stated_mm)
        return self.beyond_stated or not (within or said)
