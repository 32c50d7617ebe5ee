"""Local robust refinement: graduated Gauss-Newton on point-to-plane residuals at exact closest points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from registration._types import BoolArray, FloatArray
from registration.icp import Iteration
from registration.measures import residual_measures
from registration.noise import NoiseModel
from registration.quality import plane_rows
from registration.rigid import small_motion, transform
from registration.scan import Scan
from registration.surface import Closest, Surface

SCHEDULE_MM = (8.0, 4.0, 2.0, 1.0)
"""Scales of the graduated loss: from a capture range of centimetres down to the noise."""

TUKEY = 4.685
"""Tukey's constant: 95 % efficiency for Gaussian residuals."""


@dataclass(frozen=True)
class Refined:
    """Pose, closest points and weights at the end of a refinement."""

    model_from_scanner: FloatArray
    closest: Closest
    sigma_mm: FloatArray
    inliers: BoolArray
    history: list[Iteration]


def tukey_weights(scaled: FloatArray) -> FloatArray:
    """Tukey's biweight of residuals in units of their scale."""
    return np.where(np.abs(scaled) < TUKEY, (1.0 - (scaled / TUKEY) ** 2) ** 2, 0.0)


def refine(
    scan: Scan,
    surface: Surface,
    start: FloatArray,
    noise: NoiseModel,
    *,
    schedule_mm: tuple[float, ...] = SCHEDULE_MM,
    iterations: int = 30,
) -> Refined:
    """Refine a pose from `start` (4, 4) by iteratively reweighted Gauss-Newton.

    Each pass solves ``sum w_i/sigma_i^2 g_i g_i^T x = -sum w_i/sigma_i^2 g_i e_i`` with ``e_i = n_i . (p_i - c_i)``
    (Chen and Medioni 1992) and applies ``x`` as a left perturbation about the cloud's centre. Points whose closest
    surface faces away from the scanner have no weight: a beam cannot end on the far side.
    """
    solution = start
    history: list[Iteration] = []
    for scale in (*schedule_mm, 0.0):
        for _ in range(iterations):
            moved, closest, sigma, weights = _linearise(scan, surface, solution, noise, scale)
            used = weights > 0
            if used.sum() < 6:
                break
            measures = residual_measures(closest.signed_mm[used])
            history.append(
                Iteration(f"refine {scale:g} mm", measures.rms_mm, measures.mean_mm, measures.max_mm, int(used.sum()))
            )
            centre = moved[used].mean(axis=0)
            rows = plane_rows(moved[used], closest.normals[used], centre)
            weighted = rows * (weights / sigma**2)[used, None]
            normal = weighted.T @ rows
            damping = 1e-9 * np.diag(normal).max()
            x = -np.linalg.solve(normal + damping * np.eye(6), weighted.T @ closest.signed_mm[used])
            solution = small_motion(x, centre) @ solution
            if np.linalg.norm(x[:3]) < 1e-6 and np.linalg.norm(x[3:]) < 1e-5:
                break
    _, closest, sigma, weights = _linearise(scan, surface, solution, noise, 0.0)
    facing = _facing(scan, solution, closest)
    inliers = facing & (np.abs(closest.signed_mm) < 3.0 * sigma)
    return Refined(solution, closest, sigma, inliers, history)


def _linearise(
    scan: Scan, surface: Surface, solution: FloatArray, noise: NoiseModel, scale_mm: float
) -> tuple[FloatArray, Closest, FloatArray, FloatArray]:
    moved = transform(solution, scan.points)
    closest = surface.closest(moved)
    sigma = noise.plane_sigma(scan, solution[:3, :3], closest.normals)
    spread = np.maximum(sigma, scale_mm / TUKEY)
    weights = tukey_weights(closest.signed_mm / spread) * _facing(scan, solution, closest)
    return moved, closest, sigma, weights


def _facing(scan: Scan, solution: FloatArray, closest: Closest) -> BoolArray:
    beams = scan.beams @ solution[:3, :3].T
    return np.asarray(np.einsum("ij,ij->i", beams, closest.normals) < 0)
