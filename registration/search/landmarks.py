"""`Landmarks`: points picked in both frames, and what they say of each other and of a pose that was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import StartError
from picoradar.registration.paired_points import judge_pairs
from picoradar.registration.se3 import transform

CLICKED_MM = 6.0
"""Root mean square error of a pair clicked by hand on a scan and a model, over three axes: two clicks within 4 mm."""

OFF_SDS = 3.0
"""A landmark that many standard deviations off the pose that the surface gives is named: 1 of 1000 good ones is."""


@dataclass(frozen=True)
class Landmarks:
    """Points picked in both frames.

    Attributes
    ----------
    scanner, model : (K, 3) arrays
        The same K points in the scanner frame and in the model frame, mm.
    names : tuple of str
    """

    scanner: FloatArray
    model: FloatArray
    names: tuple[str, ...] = ()

    @classmethod
    def from_pairs(cls, pairs: Sequence[Mapping[str, Any]]) -> Landmarks:
        """Make landmarks of ``[{"scanner": [x, y, z], "model": [x, y, z], "name": ...}, ...]``.

        Raises
        ------
        StartError
            If an entry lacks a key or holds no three finite numbers.
        """
        for index, pair in enumerate(pairs):
            for key in ("scanner", "model"):
                if not isinstance(pair, Mapping) or key not in pair or not _three_numbers(pair[key]):
                    raise StartError(f'landmark {index} has no "{key}" with three finite numbers (mm)')
        return cls(
            scanner=np.array([pair["scanner"] for pair in pairs], dtype=np.float64).reshape(-1, 3),
            model=np.array([pair["model"] for pair in pairs], dtype=np.float64).reshape(-1, 3),
            names=tuple(str(pair.get("name", f"landmark {index + 1}")) for index, pair in enumerate(pairs)),
        )

    def sentences(self) -> tuple[str, ...]:
        """Say which pair is off, or which two were exchanged, as far as the pairs tell by themselves."""
        return judge_pairs(self.model, self.scanner, fle_mm=CLICKED_MM, names=self.names).sentences

    def off_mm(self, model_from_scanner: FloatArray) -> FloatArray:
        """Get how far (K,) each point of the scanner lies from its partner at a pose (4, 4), mm."""
        return np.asarray(np.linalg.norm(transform(model_from_scanner, self.scanner) - self.model, axis=1))

    def far_off(self, model_from_scanner: FloatArray) -> tuple[int, ...]:
        """Get which landmarks do not belong to a pose (4, 4) that the surface gave."""
        return tuple(int(k) for k in np.flatnonzero(self.off_mm(model_from_scanner) > OFF_SDS * CLICKED_MM))

    def beside(self, model_from_scanner: FloatArray) -> tuple[str, ...]:
        """Say which landmarks do not belong to a pose (4, 4) that the surface gave; nothing where all do."""
        off = self.off_mm(model_from_scanner)
        named = [
            f"{self.names[k] if self.names else k + 1} ({off[k]:.0f} mm)" for k in self.far_off(model_from_scanner)
        ]
        if not named:
            return ()
        return (
            f"Of the landmarks, {', '.join(named)} off the pose that the surface gives: look where they were clicked.",
        )


def _three_numbers(value: object) -> bool:
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return False
    return numbers.shape == (3,) and bool(np.isfinite(numbers).all())
