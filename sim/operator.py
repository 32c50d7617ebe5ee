"""The person at the simulated bench: clicks landmarks in a scan, reads a scale."""

from __future__ import annotations

import numpy as np

from picoradar.sim.physics import FloatArray

CLICK_SIGMA_MM = 2.5
SCALE_SIGMA_MM = 0.02  # centre of the spot in the picture of a camera on a millimetre scale


def clicks(
    landmarks: FloatArray,
    scanner_from_model: FloatArray,
    rng: np.random.Generator,
    sigma_mm: float = CLICK_SIGMA_MM,
) -> FloatArray:
    """Click landmarks in the scan, with a few millimetres of error in each direction.

    Parameters
    ----------
    landmarks : (K, 3) array
        Landmarks on the model, mm.
    scanner_from_model : (4, 4) array
        True pose of the model.
    rng : numpy.random.Generator
    sigma_mm : float, optional
        Standard deviation of a click along each axis.

    Returns
    -------
    (K, 3) float array
        Points in the scanner frame.
    """
    true_mm = np.asarray(landmarks) @ scanner_from_model[:3, :3].T + scanner_from_model[:3, 3]
    return np.asarray(true_mm + rng.normal(0.0, sigma_mm, true_mm.shape))


def scale_reading(spot_mm: FloatArray, rng: np.random.Generator) -> tuple[float, float]:
    """Read the spot (3,) on a scale across the beam: x and y in mm, as read from the camera's picture."""
    x_mm, y_mm = spot_mm[:2] + rng.normal(0.0, SCALE_SIGMA_MM, 2)
    return float(x_mm), float(y_mm)
