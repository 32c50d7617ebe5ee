"""Refines a handful of candidate poses with tissue decided over raster neighbourhoods, and ranks them."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import Float32Array, FloatArray, Neighbours
from picoradar.registration.model import DistanceField
from picoradar.registration.scan import bone_probability, log_likelihood
from picoradar.registration.search.batch import AWAY, Poses, Sampled, beam_weights, cast, sample, step

INSIDE_MM = 10.0
"""Residual that stands for "this cannot be"."""


def polish(
    field: DistanceField,
    poses: Poses,
    points: Float32Array,
    beams: Float32Array,
    around: Neighbours,
    sigma_mm: float,
    iterations: tuple[int, int] = (5, 0),
) -> tuple[Poses, FloatArray]:
    """Refine candidate poses with bone probabilities as weights; return them with mean log likelihoods (K,).

    Parameters
    ----------
    field : DistanceField
    poses : Poses
    points, beams : (3, M) arrays of float32
    around : (M, 8) array
        Neighbours of these points.
    sigma_mm : float
        Noise along the beam.
    iterations : (int, int)
        Steps on the closest points, which reach far, and steps on cast beams, which are exact.
    """
    for turn in range(sum(iterations)):
        found = sample(field, poses, points, beams)
        if turn >= iterations[0]:
            found = cast(field, found)
        probability = bone_probability(_along_beam(found), sigma_mm, around).astype(np.float32)
        poses = step(poses, found, beam_weights(found, probability), damping=1e-6)
    likelihood = log_likelihood(_along_beam(cast(field, sample(field, poses, points, beams))), sigma_mm, around)
    return poses, likelihood.mean(axis=1)


def _along_beam(found: Sampled) -> Float32Array:
    """Residuals along the beams; a surface that faces away counts as deep inside."""
    residual = found.along_beam()
    residual[found.cosine <= AWAY] = -INSIDE_MM
    return residual
