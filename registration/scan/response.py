"""Range noise from the amplitude of the echoes, for scans that come without covariances.

The time of an edge is uncertain by noise over slew, and the slew grows with the amplitude: the weaker the echo, the
noisier the range (formulas of registration, section 2.12).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.scan.noise import initial_noise
from picoradar.registration.scan.points import Scan

LARGEST_RATIO = 4.0
"""Noise differs from that of the median echo by this factor at most: beyond it, other errors rule."""


def relative_noise(response_mv: FloatArray) -> FloatArray:
    """Range noise (N,) in units of that of the median echo: inversely as the amplitude."""
    middle = max(float(np.median(response_mv)), np.finfo(np.float64).tiny)
    weakest = np.maximum(response_mv, middle / LARGEST_RATIO)
    return np.maximum(middle / weakest, 1.0 / LARGEST_RATIO)


def weighted_by_response(scan: Scan, noise_mm: float | None) -> Scan:
    """Return the scan with the range noise of each point that follows from its response.

    Parameters
    ----------
    scan : Scan
        With `response_mv`.
    noise_mm : float or None
        Range noise at the median response; from the raster itself when None.
    """
    if scan.response_mv is None:
        raise ValueError("the scan has no responses to weigh its points by")
    middle = initial_noise(scan, noise_mm)
    return replace(scan, range_sd_mm=middle * relative_noise(scan.response_mv), grid=scan.raster)
