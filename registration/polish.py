"""From a handful of candidate poses to the final one: tissue decided over raster neighbourhoods, then an exact step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from registration._types import BoolArray, FloatArray, IntArray
from registration.batch import Poses, Sampled, sample, step
from registration.field import DistanceField, Float32Array
from registration.icp import Iteration
from registration.measures import residual_measures
from registration.noise import NoiseModel
from registration.quality import plane_rows
from registration.race import beam_weights
from registration.rigid import orthonormalised, small_motion, transform
from registration.scan import Scan
from registration.surface import Closest, Surface
from registration.tissue import bone_probability, log_likelihood

REWEIGHTED_STEPS = 4
"""Weights settle in so many steps on fixed tangent planes."""

RESTING_MM = 0.02
"""The finish ends when the points' root mean square motion is below this; the tangent planes then hold."""

INSIDE_MM = 10.0
"""Residual that stands for "this cannot be"."""

STRAY_SIGMA = 3.5
"""Residuals larger than this many sigma have no weight in the last, symmetric step."""


def polish(
    field: DistanceField,
    poses: Poses,
    points: Float32Array,
    beams: Float32Array,
    around: IntArray,
    sigma_mm: float,
    iterations: int = 5,
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
    iterations : int
    """
    for _ in range(iterations):
        found = sample(field, poses, points, beams)
        probability = bone_probability(_along_beam(found), sigma_mm, around).astype(np.float32)
        poses = step(poses, found, beam_weights(found, probability), damping=1e-6)
    likelihood = log_likelihood(_along_beam(sample(field, poses, points, beams)), sigma_mm, around)
    return poses, likelihood.mean(axis=1)


def _along_beam(found: Sampled) -> Float32Array:
    """Residuals along the beams; a surface that faces away counts as deep inside."""
    residual = found.along_beam()
    residual[found.cosine <= 0] = -INSIDE_MM
    return residual


@dataclass(frozen=True)
class Final:
    """The final pose with exact closest points.

    Attributes
    ----------
    model_from_scanner : (4, 4) array
    closest : Closest
        Signed distances are those at the final pose.
    bone : (N,) array
        Probability of each point to be bone.
    log_likelihood : (N,) array
    inliers : (N,) array of bool
    history : list of Iteration
        Residuals of the bone points, step by step.
    """

    model_from_scanner: FloatArray
    closest: Closest
    bone: FloatArray
    log_likelihood: FloatArray
    inliers: BoolArray
    history: list[Iteration]


def exact_finish(
    scan: Scan,
    surface: Surface,
    start: FloatArray,
    noise: NoiseModel,
    around: IntArray,
    allowed: BoolArray | None = None,
    passes: int = 4,
) -> Final:
    """Symmetric, weighted point-to-plane steps on exact closest points, until the points rest.

    With the bone points known, their noise is symmetric; the one-sided loss alone would leave a bias.

    Parameters
    ----------
    scan : Scan
    surface : Surface
        Of the whole model.
    start : (4, 4) array
    noise : NoiseModel
    around : (N, 8) array
        Raster neighbours.
    allowed : (N,) array of bool, optional
        Points that may take part.
    passes : int
        At most so many queries of closest points; each is followed by reweighted steps on its tangent planes.
    """
    solution = start
    history: list[Iteration] = []
    for _ in range(passes):
        moved = transform(solution, scan.points)
        closest = surface.closest(moved)
        beams = scan.beams @ solution[:3, :3].T
        cosine = -np.einsum("ij,ij->i", closest.normals, beams)
        sigma = noise.plane_sigma(scan, solution[:3, :3], closest.normals)
        usable = cosine > 0.05 if allowed is None else (cosine > 0.05) & allowed
        centre = moved.mean(axis=0)
        rows = plane_rows(moved, closest.normals, centre)
        stretch = 1.0 / np.maximum(cosine, 0.2)
        x = np.zeros(6)
        for _ in range(REWEIGHTED_STEPS):
            residual = closest.signed_mm + rows @ x
            bone = bone_probability(residual * stretch, sigma * stretch, around) * usable
            weight = np.asarray(bone * (np.abs(residual) < STRAY_SIGMA * sigma) / sigma**2, dtype=np.float64)
            normal = (rows * weight[:, None]).T @ rows
            normal += 1e-9 * np.diag(np.diag(normal) + 1e-9)
            used = np.abs(residual[bone > 0.5])
            if used.size:
                measures = residual_measures(used)
                history.append(Iteration("exact", measures.rms_mm, measures.mean_mm, measures.max_mm, int(used.size)))
            x = np.asarray(-np.linalg.solve(normal, rows.T @ (weight * closest.signed_mm)), dtype=np.float64)
        move = np.cross(x[:3], moved - centre) + x[3:]
        solution = orthonormalised(small_motion(x, centre) @ solution)
        if np.sqrt((move**2).sum(axis=1).mean()) < RESTING_MM:
            break
    residual = closest.signed_mm + rows @ x
    bone = bone_probability(residual * stretch, sigma * stretch, around) * usable
    likelihood = log_likelihood(np.where(cosine > 0, residual * stretch, -INSIDE_MM), sigma * stretch, around)
    inliers = (bone > 0.5) & (np.abs(residual) < STRAY_SIGMA * sigma)
    at_end = Closest(closest.points, closest.normals, residual, closest.faces)
    return Final(solution, at_end, bone, likelihood, inliers, history)
