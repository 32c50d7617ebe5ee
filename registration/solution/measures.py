"""The measures of section 3.4.1 of the dissertation, with and without a known truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.se3 import inverse, rotation_angle_deg


@dataclass(frozen=True)
class ResidualMeasures:
    """Measures of residuals (equations 3.12 to 3.15).

    Attributes
    ----------
    nlse : float
        Mean of the squared residuals, mm^2.
    rms_mm, mean_mm, max_mm : float
        Root mean square (NRMS), mean of the magnitudes (NARE), largest magnitude (MRE).
    """

    nlse: float
    rms_mm: float
    mean_mm: float
    max_mm: float


def residual_measures(residuals_mm: FloatArray) -> ResidualMeasures:
    """Measures of residuals (N,) in mm, N at least 1."""
    size = np.abs(residuals_mm)
    nlse = float(np.mean(size**2))
    return ResidualMeasures(
        nlse=nlse, rms_mm=float(np.sqrt(nlse)), mean_mm=float(size.mean()), max_mm=float(size.max())
    )


@dataclass(frozen=True)
class PoseError:
    """Error of a pose against the truth: angle of the rotation, and shift of a stated point."""

    rotation_deg: float
    translation_mm: float


def pose_error(estimate: FloatArray, truth: FloatArray, at: FloatArray) -> PoseError:
    """Compare two ``model_from_scanner`` poses.

    Parameters
    ----------
    estimate, truth : (4, 4) arrays
    at : (3,) array
        Point of the model frame at which the shift is taken, mm. (The norm of the translation column, equation 3.16,
        depends on where the origin happens to be.)
    """
    motion = estimate @ inverse(truth)
    shift = motion[:3, :3] @ at + motion[:3, 3] - at
    return PoseError(rotation_deg=rotation_angle_deg(motion[:3, :3]), translation_mm=float(np.linalg.norm(shift)))


@dataclass(frozen=True)
class Iteration:
    """One entry of the convergence history: which stage, and the residuals of the points still in use."""

    stage: str
    rms_mm: float
    mean_mm: float
    max_mm: float
    points: int
