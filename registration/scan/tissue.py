"""Bone or tissue: decided for each point together with its neighbours in the raster.

Tissue stands in front of bone in clumps: a point between tissue points is tissue, and nothing at all lies inside bone.
The log odds of a point are its own likelihood ratio plus a share of its neighbours' (one mean-field pass of a Markov
random field), so that thin tissue, which one range value cannot tell from noise, is told by nine.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray, Neighbours
from picoradar.registration.scan.points import Scan

COUPLING = 0.25
"""Share of a neighbour's log odds."""

TISSUE_PER_MM = 0.1
"""Density of tissue heights: anything up to about a centimetre."""

TISSUE_ONSET_MM = 0.7
"""Thinner films pass for bone."""

STRAY = 2e-3
"""Density of anything else (1/mm): stray echoes, points inside bone."""

INDEPENDENT_POINTS = 1500
"""Points of a raster finer than that see the same clumps of tissue: what poses differ by grows no further with them."""

CLIP = 3.0
"""Largest log odds that a neighbour may put in."""


def raster_noise(scan: Scan) -> float:
    """Upper bound of the range noise in mm, from how each range departs from its neighbours' mean; needs no model.

    The lower quartile of the departures counts, since tissue edges and rims depart for other reasons.
    """
    ranges, around = scan.ranges, scan.around
    count = neighbour_sum(np.ones(len(scan)), around)
    full = count >= 6
    if full.sum() < 20:
        return float("nan")
    beside = neighbour_sum(ranges - ranges.mean(), around)[full] / count[full]
    departure = np.abs((ranges - ranges.mean())[full] - beside) / np.sqrt(1.0 + 1.0 / count[full])
    return float(np.quantile(departure, 0.25) / 0.31864)


def log_odds(residuals: npt.NDArray[np.floating], sigma_mm: npt.NDArray[np.floating] | float) -> FloatArray:
    """Log of bone's likelihood over tissue's for residuals along the beam, (...) mm."""
    tissue = TISSUE_PER_MM / (1.0 + np.exp(np.clip((TISSUE_ONSET_MM - residuals) / 0.2, -50.0, 50.0))) + STRAY
    return np.asarray(_bone_likelihood(residuals, sigma_mm) - np.log(tissue))


def _bone_likelihood(
    residuals: npt.NDArray[np.floating], sigma_mm: npt.NDArray[np.floating] | float
) -> npt.NDArray[np.floating]:
    """Log density of bone; single precision stays single."""
    z = residuals / sigma_mm
    scale = np.log(sigma_mm) + 0.5 * math.log(2.0 * math.pi)
    return np.asarray(-0.5 * z * z - (float(scale) if np.ndim(scale) == 0 else scale))


def neighbour_sum(values: npt.NDArray[np.floating], around: Neighbours) -> FloatArray:
    """Sum (..., N) of the `values` (..., N) of each point's neighbours `around` (N, 8)."""
    padded = np.concatenate([values, np.zeros((*values.shape[:-1], 1), dtype=values.dtype)], axis=-1)
    total = padded.take(around[:, 0], axis=-1)
    for one in around.T[1:]:  # one after the other: all eight of a large cloud at once are eight times its size
        total += padded.take(one, axis=-1)
    return np.asarray(total)


def neighbour_odds(own: FloatArray, around: Neighbours) -> FloatArray:
    """Log odds (..., N) that the neighbours `around` (N, 8) lend to each point, from their own ones (..., N)."""
    return np.asarray(COUPLING * neighbour_sum(np.clip(own, -CLIP, CLIP), around))


def bone_probability(
    residuals: npt.NDArray[np.floating], sigma_mm: npt.NDArray[np.floating] | float, around: Neighbours
) -> FloatArray:
    """Probability (..., N) of being bone for residuals (..., N) along the beam."""
    own = log_odds(residuals, sigma_mm)
    own += neighbour_odds(own, around)
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(own, -50.0, 50.0))))


def log_likelihood(
    residuals: npt.NDArray[np.floating], sigma_mm: npt.NDArray[np.floating] | float, around: Neighbours
) -> FloatArray:
    """Log likelihood (..., N) of the mixture of bone and tissue, its shares lent by the neighbours: poses' rank."""
    own = log_odds(residuals, sigma_mm)
    prior = neighbour_odds(own, around)
    bone = _bone_likelihood(residuals, sigma_mm)
    return np.asarray(bone - own + np.logaddexp(0.0, own + prior) - np.logaddexp(0.0, prior))
