"""Standard deviation of each plane residual: range noise along the beam, pointing noise across it, model error.

Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.scan.points import Scan
from picoradar.registration.scan.tissue import neighbour_sum
from picoradar.registration.settings import NoiseSettings

SIGMA_PER_MAD = 1.4826
"""Standard deviation of a Gaussian over its median absolute deviation: 1 / Phi^-1(3/4)."""

LOWER_QUARTILE = 0.31864
"""Lower quartile of the magnitude of a standard Gaussian variable: Phi^-1(5/8)."""


@dataclass(frozen=True)
class NoiseModel:
    """Noise of one measured point.

    Attributes
    ----------
    range_mm : float
        Standard deviation along the beam.
    lateral_mm : float
        Standard deviation across the beam, per axis.
    model_mm : float
        Standard deviation of the model's surface along its normal (facets, segmentation).
    """

    range_mm: float
    lateral_mm: float
    model_mm: float

    @classmethod
    def of(cls, range_mm: float, settings: NoiseSettings) -> NoiseModel:
        """Noise with this standard deviation along the beam, and the settings' across it and of the model."""
        return cls(range_mm, settings.lateral_mm, settings.model_mm)

    def plane_sigma(self, scan: Scan, rotation: FloatArray, normals: FloatArray) -> FloatArray:
        """Standard deviations (N,) of ``n . (p - c)``: ``n^T Sigma n`` plus the model's part [eq. 6].

        Range noise counts in full at normal incidence only, pointing noise at grazing incidence only.

        Parameters
        ----------
        scan : Scan
            Its covariances are used where given, else its points' own range noise where that is known.
        rotation : (3, 3) array
            Of `model_from_scanner`.
        normals : (N, 3) array
            Model frame.
        """
        in_scanner = normals @ rotation
        if scan.covariance is not None:
            variance = np.einsum("ni,nij,nj->n", in_scanner, scan.covariance, in_scanner)
        else:
            cosine2 = np.einsum("ij,ij->i", in_scanner, scan.beams) ** 2
            range_mm = self.range_mm if scan.range_sd_mm is None else scan.range_sd_mm
            variance = range_mm**2 * cosine2 + self.lateral_mm**2 * (1.0 - cosine2)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0) + self.model_mm**2), dtype=np.float64)


def mad_scale(residuals: FloatArray) -> float:
    """Standard deviation of Gaussian residuals (N,) about zero by their median absolute deviation."""
    return SIGMA_PER_MAD * float(np.median(np.abs(residuals)))


def estimated_range_noise(along_beam_mm: FloatArray, otherwise_mm: float, settings: NoiseSettings) -> float:
    """Range noise from residuals along the beam (MAD scale); `otherwise_mm` when there are too few to tell."""
    if len(along_beam_mm) < settings.min_residuals:
        return otherwise_mm
    return _plausible(mad_scale(along_beam_mm), settings)


def initial_noise(scan: Scan, noise_mm: float | None, settings: NoiseSettings) -> float:
    """Noise along the beam in mm to search with: as given, else that of the points themselves or of the raster.

    What the points tell is kept to what is plausible; the beam fit weighs each by its own noise, however small.
    """
    if noise_mm is not None:
        return noise_mm
    if scan.range_sd_mm is not None:
        return _plausible(float(np.median(scan.range_sd_mm)), settings)
    if scan.covariance is not None:
        along = np.einsum("ni,nij,nj->n", scan.beams, scan.covariance, scan.beams)
        return _plausible(float(np.sqrt(max(0.0, float(np.median(along))))), settings)
    found = raster_noise(scan, settings)
    if not np.isfinite(found):
        return settings.typical_range_mm
    return float(np.clip(settings.raster_share * found, settings.raster_min_mm, settings.raster_max_mm))


def _plausible(range_mm: float, settings: NoiseSettings) -> float:
    return float(np.clip(range_mm, settings.min_range_mm, settings.max_range_mm))


def raster_noise(scan: Scan, settings: NoiseSettings) -> float:
    """Upper bound of the range noise in mm, from how ranges depart from their neighbours' mean [eq. 7]; needs no model.

    The lower quartile of the departures counts, since tissue edges and rims depart for other reasons. NaN where too few
    points have neighbours.
    """
    ranges, around = scan.ranges, scan.around
    count = neighbour_sum(np.ones(len(scan)), around)
    full = count >= settings.raster_min_neighbours
    if full.sum() < settings.min_residuals:
        return float("nan")
    neighbours_mean = neighbour_sum(ranges - ranges.mean(), around)[full] / count[full]
    departure = np.abs((ranges - ranges.mean())[full] - neighbours_mean) / np.sqrt(1.0 + 1.0 / count[full])
    return float(np.quantile(departure, 0.25) / LOWER_QUARTILE)
