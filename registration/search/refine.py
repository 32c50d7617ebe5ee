"""Refines a handful of candidate poses with tissue decided over raster neighbourhoods, and ranks them."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import Float32Array, FloatArray, Neighbours
from picoradar.registration.model import DistanceField
from picoradar.registration.scan import bone_probability, log_likelihood
from picoradar.registration.search.field_factor import Beams, Poses, Sampled, beam_weights, cast, sample, step
from picoradar.registration.settings import RobustSettings


def refined(
    field: DistanceField,
    poses: Poses,
    beams: Beams,
    around: Neighbours,
    sigma_mm: float,
    steps: tuple[int, int],
    settings: RobustSettings,
) -> tuple[Poses, FloatArray]:
    """Refine candidate poses with bone probabilities as weights; return them with mean log likelihoods (K,).

    Parameters
    ----------
    field : DistanceField
    poses : Poses
    beams : Beams
    around : (M, 8) array
        Neighbours of these points.
    sigma_mm : float
        Noise along the beam.
    steps : (int, int)
        Steps on the closest points, which reach far, and steps on cast beams, which are exact.
    settings : RobustSettings
    """
    for number in range(sum(steps)):
        found = sample(field, poses, beams, settings.step)
        if number >= steps[0]:
            found = cast(field, found, settings.step)
        along = _along_beam(found, settings)
        probability = bone_probability(along, sigma_mm, around, settings.tissue).astype(np.float32)
        poses = step(poses, found, beam_weights(found, probability), settings.step, settings.step.refine_damping)
    met = cast(field, sample(field, poses, beams, settings.step), settings.step)
    likelihood = log_likelihood(_along_beam(met, settings), sigma_mm, around, settings.tissue)
    return poses, likelihood.mean(axis=1)


def _along_beam(found: Sampled, settings: RobustSettings) -> Float32Array:
    """Residuals along the beams; a surface that faces away counts as deep inside."""
    residual = found.along_beam()
    facing_away = found.cosine <= np.float32(settings.step.facing_away_cosine)
    residual[facing_away] = -settings.tissue.residual_inside_mm
    return residual
