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
OFFSETS_TURNED = np.column_stack([-OFFSETS[:, 1], OFFSETS[:, 0]])


def bundle(origin: FloatArray, direction: FloatArray, diameter_mm: float) -> FloatArray:
    """Get the origins of the rays of one beam whose rays all have its direction.

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
    return np.asarray(origin + (diameter_mm * OFFSETS) @ _across(direction))


def waisted(
    origin: FloatArray, direction: FloatArray, waist_mm: float, focus_mm: float, divergence_mrad: float
) -> tuple[FloatArray, FloatArray]:
    """Get the rays of a beam that is narrowest at its focus.

    The rays of the ring are askew: they pass each other like the straight lines of a hyperboloid, so that the ring's
    diameter is hypot(waist, divergence x distance from the focus), as that of a Gaussian beam (Arnaud, Appl. Opt. 24
    (1985) 538). The ring turns on the way; its second moments stay those of the spot.

    Parameters
    ----------
    origin, direction : (3,) arrays
        The beam's axis, which is the first ray.
    waist_mm : float
        Diameter of the spot at the focus; 0 gives the axis alone.
    focus_mm : float
        Distance of the focus from the origin.
    divergence_mrad : float
        Full angle at which the spot grows far off the focus.

    Returns
    -------
    origins, directions : (N, 3) float arrays
        Each ray stands for 1/N of the energy.
    """
    if waist_mm == 0:
        return origin[None], direction[None]
    across = _across(direction)
    tilt = divergence_mrad * 1e-3 * OFFSETS_TURNED
    origins = origin + (waist_mm * OFFSETS - focus_mm * tilt) @ across
    directions = direction + tilt @ across
    directions[1:] /= math.sqrt(1.0 + (divergence_mrad * 1e-3 * RING_PER_DIAMETER) ** 2)
    return origins, directions


def _across(direction: FloatArray) -> FloatArray:
    """Two vectors (2, 3) across a beam (Duff et al., JCGT 6 (2017) 1), for z > -1."""
    x, y, z = direction.tolist()
    a = -1.0 / (1.0 + z)
    b = x * y * a
    return np.array([[1.0 + x * x * a, b, -x], [b, 1.0 + y * y * a, -y]])
