"""Where a search starts: low-discrepancy rotations, the same on every run."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.se3 import frame_about, rotation_from_vector

_PLASTIC = 1.2207440846057596
"""Root of x^4 = x + 1, the base of the three-dimensional R sequence (Roberts 2018)."""


def low_discrepancy(count: int, first: int = 0) -> FloatArray:
    """Points (count, 3) of the unit cube that fill it evenly, however many are taken; from number `first` on."""
    steps = _PLASTIC ** -np.arange(1.0, 4.0)
    return np.asarray((0.5 + np.outer(np.arange(first + 1, first + count + 1), steps)) % 1.0, dtype=np.float64)


def rotations_in_cone(
    fixed_axis: FloatArray, moving_axis: FloatArray, half_angle_deg: float, count: int, first: int = 0
) -> FloatArray:
    """Rotations (count, 3, 3) that bring `moving_axis` within a cone about `fixed_axis`, at any roll.

    Evenly spread over the cap and the roll; a half angle of 180 deg gives all of SO(3).
    """
    u = low_discrepancy(count, first)
    tilt = np.arccos(1.0 - u[:, 0] * (1.0 - np.cos(np.radians(half_angle_deg))))
    azimuth, roll = 2.0 * np.pi * u[:, 1], 2.0 * np.pi * u[:, 2]
    zero = np.zeros(count)
    tilted = rotation_from_vector(np.stack([-np.sin(azimuth) * tilt, np.cos(azimuth) * tilt, zero], axis=1))
    rolled = rotation_from_vector(np.stack([zero, zero, roll], axis=1))
    return np.asarray(frame_about(fixed_axis) @ (tilted @ rolled) @ frame_about(moving_axis).T, dtype=np.float64)


def rotations_near(start: FloatArray, half_angle_deg: float, count: int, first: int = 0) -> FloatArray:
    """Rotations (count, 3, 3) within `half_angle_deg` of `start` (3, 3), the first of them `start` itself."""
    u = low_discrepancy(count - 1, first)
    angle = np.radians(half_angle_deg) * np.cbrt(u[:, 0])
    height, azimuth = 1.0 - 2.0 * u[:, 1], 2.0 * np.pi * u[:, 2]
    ring = np.sqrt(1.0 - height**2)
    axis = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), height], axis=1)
    turned = rotation_from_vector(axis * angle[:, None]) @ start
    return np.concatenate([start[None], turned])
