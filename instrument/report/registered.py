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
    def known_wrong(self) -> bool:
        """Get whether the true pose is known, and its error is beyond what was stated: at the targets beyond the
        largest error stated there; where the verdict is a pass or nothing was stated, beyond the tolerance."""
        error, found = self.truth_error, self.registration
        if error is None:
            return False
        stated = [target.stated_mm for target in found.targets]
        known = bool(stated) and all(math.isfinite(mm) for mm in stated)
        if known and not error.get("at_targets_mm", 0.0) <= max(stated):
            return True
        within = error["rotation_deg"] <= self.tolerance.rotation_deg
        within &= error["translation_mm"] <= self.tolerance.target_mm
        return not within and (found.verdict == "pass" or not known)
