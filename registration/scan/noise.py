"""Standard deviation of each plane residual: range noise along the beam, pointing noise across it, model error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.scan.points import Scan
from picoradar.registration.scan.tissue import raster_noise

TYPICAL_RANGE_MM = 0.4
"""Range noise of a point averaged over 8 sweeps, assumed until the residuals tell."""

PLAUSIBLE_RANGE_MM = (0.02, 5.0)
"""Range noise of any instrument that this is for: what is found beyond it is taken for the nearer end."""

MIN_RESIDUALS = 20
"""Fewer residuals cannot tell their scale."""


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

    range_mm: float = TYPICAL_RANGE_MM
    lateral_mm: float = 0.04
    model_mm: float = 0.03

    def plane_sigma(self, scan: Scan, rotation: FloatArray, normals: FloatArray) -> FloatArray:
        """Standard deviations (N,) of ``n . (p - c)``: ``n^T Sigma n`` plus the model's part.

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


def estimated_range_noise(along_beam_mm: FloatArray, otherwise_mm: float) -> float:
    """Range noise from residuals along the beam (MAD scale); `otherwise_mm` when there are too few to tell."""
    if len(along_beam_mm) < MIN_RESIDUALS:
        return otherwise_mm
    return float(np.clip(1.4826 * np.median(np.abs(along_beam_mm)), *PLAUSIBLE_RANGE_MM))


def initial_noise(scan: Scan, noise_mm: float | None) -> float:
    """Noise along the beam in mm to search with: as given, else that of the points themselves or of the raster.

    What the points tell is kept within `PLAUSIBLE_RANGE_MM`; the finish weighs each by its own noise, however small.
    """
    if noise_mm is not None:
        return noise_mm
    if scan.range_sd_mm is not None:
        return float(np.clip(np.median(scan.range_sd_mm), *PLAUSIBLE_RANGE_MM))
    if scan.covariance is not None:
        along = np.einsum("ni,nij,nj->n", scan.beams, scan.covariance, scan.beams)
        return float(np.clip(np.sqrt(max(0.0, float(np.median(along)))), *PLAUSIBLE_RANGE_MM))
    found = raster_noise(scan)
    return float(np.clip(0.65 * found, 0.1, 2.0)) if np.isfinite(found) else TYPICAL_RANGE_MM
