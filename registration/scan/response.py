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
from picoradar.registration.settings import NoiseSettings


def relative_noise(response_mv: FloatArray, max_ratio: float) -> FloatArray:
    """Range noise (N,) in units of that of the median echo: inversely as the amplitude, by `max_ratio` at most."""
    middle = max(float(np.median(response_mv)), np.finfo(np.float64).tiny)
    weakest = np.maximum(response_mv, middle / max_ratio)
    return np.maximum(middle / weakest, 1.0 / max_ratio)


def weighted_by_response(scan: Scan, noise_mm: float | None, settings: NoiseSettings) -> Scan:
    """Return the scan with the range noise of each point that follows from its response.

    Parameters
    ----------
    scan : Scan
        With `response_mv`.
    noise_mm : float or None
        Range noise at the median response; from the raster itself when None.
    settings : NoiseSettings
    """
    if scan.response_mv is None:
        raise ValueError("the scan has no responses to weigh its points by")
    middle = initial_noise(scan, noise_mm, settings)
    return replace(
        scan, range_sd_mm=middle * relative_noise(scan.response_mv, settings.max_response_ratio), grid=scan.raster
    )
