"""Bone or tissue: decided for each point together with its neighbours in the raster.

Tissue stands in front of bone in clumps: a point between tissue points is tissue, and nothing at all lies inside bone.
The log odds of a point are its own likelihood ratio plus a share of its neighbours' (one mean-field pass of a Markov
random field), so that thin tissue, which one range value cannot tell from noise, is told by nine.

Residuals are lengths along the beam, positive in front of bone. Equation numbers are those of ``docs/registration.md``.

References
----------
Li, Markov Random Field Modeling in Image Analysis (2009): mean-field approximation.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray, Neighbours
from picoradar.registration.settings import TissueSettings

Floats: TypeAlias = npt.NDArray[np.floating]

MAX_EXPONENT = 50.0
"""Exponents are cut here: exp(50) is as good as infinite, and does not overflow in single precision."""


def log_odds(residuals_mm: Floats, sigma_mm: Floats | float, tissue: TissueSettings) -> FloatArray:
    """Log of bone's likelihood over tissue's [eq. 3] for residuals along the beam, (...) mm."""
    below_onset = np.clip((tissue.onset_mm - residuals_mm) / tissue.onset_width_mm, -MAX_EXPONENT, MAX_EXPONENT)
    density = tissue.density_per_mm / (1.0 + np.exp(below_onset)) + tissue.stray_per_mm
    return np.asarray(_log_bone_density(residuals_mm, sigma_mm) - np.log(density))


def _log_bone_density(residuals_mm: Floats, sigma_mm: Floats | float) -> Floats:
    """Log of the normal density of bone [eq. 3]; single precision stays single."""
    z = residuals_mm / sigma_mm
    scale = np.log(sigma_mm) + 0.5 * math.log(2.0 * math.pi)
    return np.asarray(-0.5 * z * z - (float(scale) if np.ndim(scale) == 0 else scale))


def neighbour_sum(values: Floats, around: Neighbours) -> FloatArray:
    """Sum (..., N) of the `values` (..., N) of each point's neighbours `around` (N, 8)."""
    padded = np.concatenate([values, np.zeros((*values.shape[:-1], 1), dtype=values.dtype)], axis=-1)
    total = padded.take(around[:, 0], axis=-1)
    for one in around.T[1:]:  # one after the other: all eight of a large cloud at once are eight times its size
        total += padded.take(one, axis=-1)
    return np.asarray(total)


def neighbour_odds(own: FloatArray, around: Neighbours, tissue: TissueSettings) -> FloatArray:
    """Log odds (..., N) that the neighbours `around` (N, 8) lend to each point [eq. 4], from their own (..., N)."""
    limit = tissue.max_neighbour_nats
    return np.asarray(tissue.coupling * neighbour_sum(np.clip(own, -limit, limit), around))


def bone_probability(
    residuals_mm: Floats, sigma_mm: Floats | float, around: Neighbours, tissue: TissueSettings
) -> FloatArray:
    """Probability (..., N) of being bone [eq. 4] for residuals (..., N) along the beam."""
    own = log_odds(residuals_mm, sigma_mm, tissue)
    own += neighbour_odds(own, around, tissue)
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(own, -MAX_EXPONENT, MAX_EXPONENT))))


def observed_share(
    residuals_mm: Floats, sigma_mm: Floats | float, around: Neighbours, tissue: TissueSettings
) -> FloatArray:
    """Share (N,) of each point's information that is left when nobody says whether it is bone [eq. 10].

    The derivative of ``P(r) r``, the pull of a point on the pose: one for a point that is bone beyond doubt, nothing
    for tissue, and negative between, where moving away from a point makes it tissue and so ends its pull. (Louis, J.
    R. Stat. Soc. B 44:226, 1982: the information observed is that of complete data less what is missing.)
    """
    own = log_odds(residuals_mm, sigma_mm, tissue)
    odds = own + neighbour_odds(own, around, tissue)
    probability = 1.0 / (1.0 + np.exp(-np.clip(odds, -MAX_EXPONENT, MAX_EXPONENT)))
    below_onset = np.clip((tissue.onset_mm - residuals_mm) / tissue.onset_width_mm, -MAX_EXPONENT, MAX_EXPONENT)
    above = 1.0 / (1.0 + np.exp(below_onset))
    tissue_density = tissue.density_per_mm * above + tissue.stray_per_mm
    tissue_slope = tissue.density_per_mm * above * (1.0 - above) / tissue.onset_width_mm
    slope = -residuals_mm / np.square(sigma_mm) - tissue_slope / tissue_density  # of the log odds
    return np.asarray(probability + probability * (1.0 - probability) * residuals_mm * slope, dtype=np.float64)


def log_likelihood(
    residuals_mm: Floats, sigma_mm: Floats | float, around: Neighbours, tissue: TissueSettings
) -> FloatArray:
    """Log likelihood (..., N) of the mixture [eq. 11], its shares lent by the neighbours: what poses are ranked by."""
    own = log_odds(residuals_mm, sigma_mm, tissue)
    prior = neighbour_odds(own, around, tissue)
    bone = _log_bone_density(residuals_mm, sigma_mm)
    return np.asarray(bone - own + np.logaddexp(0.0, own + prior) - np.logaddexp(0.0, prior))
