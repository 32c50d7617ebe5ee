"""The spot of the laser as a bundle of rays, so that an edge inside it gives two echoes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Seven equal rays, one in the middle and six on a ring, have the second moments of a Gaussian spot of diameter d
# (1/e^2) when the ring has this radius in units of d: 6/7 r^2 / 2 = d^2 / 16.
RING_PER_DIAMETER = math.sqrt(7.0 / 48.0)
_ANGLES = np.arange(6) * math.pi / 3
OFFSETS = np.vstack([[0.0, 0.0], RING_PER_DIAMETER * np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])])


def bundle(origin: FloatArray, direction: FloatArray, diameter_mm: float) -> FloatArray:
    """Get the origins of the rays of one beam; all have its direction.

    Parameters
    ----------
    origin, direction : (3,) arrays
        The beam's axis, which is the first ray.
    diameter_mm : float
        Diameter of the spot; 0 gives the axis alone.

    Returns
    -------
    (N, 3) float array
        Origins, each standing for 1/N of the energy.
    """
    if diameter_mm == 0:
        return origin[None]
    x, y, z = direction.tolist()
    # Two vectors across the beam (Duff et al., JCGT 6 (2017) 1), for z > -1.
    a = -1.0 / (1.0 + z)
    b = x * y * a
    across = np.array([[1.0 + x * x * a, b, -x], [b, 1.0 + y * y * a, -y]])
    return np.asarray(origin + (diameter_mm * OFFSETS) @ across)


def off_focus_mm(diameter_mm: float, beyond_mm: float, divergence_mrad: float) -> float:
    """Get the diameter of the spot some way before or behind its focus; where the beam meets nothing, as in focus."""
    if not math.isfinite(beyond_mm):
        return diameter_mm
    return math.hypot(diameter_mm, divergence_mrad * 1e-3 * beyond_mm)
