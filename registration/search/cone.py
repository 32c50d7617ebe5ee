"""A cone of directions that the scanner may look from: what an operator knows without clicking a point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.errors import StartError
from picoradar.registration.search.rotations import rotations_in_cone

ROUNDING = 1e-12
"""Of a cosine: a direction on the border lies inside."""


@dataclass(frozen=True, eq=False)
class Cone:
    """Directions of the model frame, from the model towards the scanner; any roll about them is allowed.

    Attributes
    ----------
    towards : (3,) array
        The axis, of any length; kept as a unit vector.
    half_angle_deg : float
        Over 0, at most 180.

    Raises
    ------
    StartError
        For an axis that is no direction, or another half angle.
    """

    towards: FloatArray
    half_angle_deg: float

    def __post_init__(self) -> None:
        try:
            towards = np.asarray(self.towards, dtype=np.float64).reshape(3)
            half = float(self.half_angle_deg)
        except (TypeError, ValueError) as error:
            raise StartError(
                f"a cone has three numbers towards the scanner and a half angle in deg ({error})"
            ) from error
        largest = float(np.abs(towards).max())
        if not (np.isfinite(largest) and largest > 0.0):
            raise StartError(f"the cone's axis {towards.tolist()} is no direction: give three numbers, not all zero")
        towards = towards / largest
        if not 0.0 < half <= 180.0:
            raise StartError(f"the cone's half angle is {half} deg: give more than 0 and at most 180")
        object.__setattr__(self, "towards", towards / np.linalg.norm(towards))
        object.__setattr__(self, "half_angle_deg", half)

    @classmethod
    def from_mapping(cls, given: Mapping[str, Any]) -> Cone:
        """Make a cone of ``{"towards": [x, y, z], "half_angle_deg": a}``; else `StartError`."""
        try:
            return cls(given["towards"], given["half_angle_deg"])
        except KeyError as error:
            raise StartError(
                f'a cone of directions is {{"towards": [x, y, z], "half_angle_deg": a}}: {error} is missing'
            ) from error

    def holds(self, directions: FloatArray, margin_deg: float = 0.0) -> BoolArray:
        """Which of the unit `directions` (N, 3) lie in the cone widened by `margin_deg`."""
        min_cosine = np.cos(np.radians(min(180.0, self.half_angle_deg + margin_deg)))
        return np.asarray(directions @ self.towards >= min_cosine - ROUNDING)


ANYWHERE = Cone(np.array([0.0, 0.0, 1.0]), 180.0)
"""All directions."""


def rotations_within(cones: Sequence[Cone], towards: FloatArray, count: int, first: int = 0) -> FloatArray:
    """Rotations (K, 3, 3) that bring the unit vector `towards` into all of the cones, at any roll.

    Evenly spread over the narrowest cone, `count` of them from number `first` on, less those outside another.
    """
    narrowest, *others = sorted(cones, key=lambda cone: cone.half_angle_deg)
    rotations = rotations_in_cone(narrowest.towards, towards, narrowest.half_angle_deg, count, first)
    for cone in others:
        rotations = rotations[cone.holds(rotations @ towards)]
    return rotations
