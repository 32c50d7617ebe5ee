"""The experiments behind tables 4.1 to 4.6 and 5.1 of the dissertation, each with the parameters of its table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from bench_scans import BenchScan

from picoradar.registration import DissertationSettings, Model, Registration, pose_error, register
from picoradar.registration.classic import DissertationResult, register_dissertation
from picoradar.registration.least_squares import plane_rows
from picoradar.registration.se3 import inverse, pose, rotation_from_vector, transform

TIGHT_MM2 = 1e-18
"""Stop rule where the dissertation states the number of iterations only: they are all run."""

TABLE_4_1 = DissertationSettings(40, TIGHT_MM2, suppression_runs=0, outlier_threshold_mm=None)
TABLE_4_2 = replace(TABLE_4_1, suppression_runs=5, perturbation_deg=7.5, perturbation_mm=1.2)
TABLE_4_3 = DissertationSettings(
    suppression_runs=6, perturbation_deg=2.5, perturbation_mm=1.4, outlier_threshold_mm=None
)
TABLE_4_4 = DissertationSettings(suppression_runs=6, perturbation_deg=3.0, perturbation_mm=2.4)
TABLE_4_5 = replace(TABLE_4_4, perturbation_mm=5.2, outlier_threshold_mm=None)
TABLE_4_6 = replace(TABLE_4_4, perturbation_mm=1.2, outlier_threshold_mm=None)
TABLE_5_1 = replace(TABLE_4_4, perturbation_deg=3.5, perturbation_mm=4.7)

ABOUT_X = np.array([1.0, 0.0, 0.0])


def prism() -> tuple[np.ndarray, np.ndarray]:
    """Two sloping faces over a 40 x 40 mm base, ridge 40 mm high along x: 3321 points, 41 x 81 (section 4.1.1)."""
    along_ridge, across = np.meshgrid(np.linspace(-20, 20, 41), np.linspace(-20, 20, 81), indexing="ij")
    vertices = np.stack([along_ridge.ravel(), across.ravel(), 40.0 - 2.0 * np.abs(across).ravel()], axis=1)
    a = (np.arange(40)[:, None] * 81 + np.arange(80)).ravel()
    return vertices, np.concatenate([np.stack([a, a + 81, a + 82], axis=1), np.stack([a, a + 82, a + 1], axis=1)])


@dataclass(frozen=True)
class Copy:
    """A copy of the model's points, turned away and registered back."""

    rotation_deg: float
    translation_mm: float
    rms_mm: float
    step_mm: float
    result: DissertationResult


def copy(
    model: Model, centre: np.ndarray, angle_deg: float, noise_mm: float, seed: int, settings: DissertationSettings
) -> Copy:
    """Turn the model's own points about x through `centre`, add Gaussian noise to every coordinate, register back.

    `rms_mm` is that of the residuals, `step_mm` the root mean square motion of the points in one more iteration.
    """
    rotation = rotation_from_vector(np.radians(angle_deg) * ABOUT_X)
    away = pose(rotation, centre - rotation @ centre)
    noise = np.random.default_rng(seed).normal(0.0, noise_mm, model.vertices.shape) if noise_mm > 0 else 0.0
    data = transform(away, model.vertices) + noise
    found = register_dissertation(data, model.surface, np.eye(4), replace(settings, seed=seed))
    error = pose_error(found.model_from_scanner, inverse(away), centre)
    here = transform(found.model_from_scanner, data)
    once = replace(settings, max_iterations=1, suppression_runs=0)
    after = register_dissertation(data, model.surface, found.model_from_scanner, once)
    moved = transform(after.model_from_scanner, data) - here
    rms = float(np.sqrt(np.mean(model.closest(here).signed_mm ** 2)))
    step = float(np.sqrt((moved**2).sum(axis=1).mean()))
    return Copy(error.rotation_deg, error.translation_mm, rms, step, found)


def away_from(truth: np.ndarray, points: np.ndarray, angle_deg: float, shift_mm: float, seed: int) -> np.ndarray:
    """A start of exactly this rotation and shift from the true pose, about the middle of the points."""
    rng = np.random.default_rng(seed)
    axis, direction = rng.normal(size=(2, 3))
    rotation = rotation_from_vector(np.radians(angle_deg) * axis / np.linalg.norm(axis))
    centre = transform(truth, points).mean(axis=0)
    return pose(rotation, centre - rotation @ centre + shift_mm * direction / np.linalg.norm(direction)) @ truth


@dataclass(frozen=True)
class Matched:
    """A scan registered by the dissertation's method: plainly, and with outliers eliminated; and by the robust one."""

    plain: Registration
    eliminated: Registration
    robust: Registration


def match(scan: BenchScan, model: Model, start: object, settings: DissertationSettings) -> Matched:
    """Register a scan of the simulated bench from `start` three times."""
    points = scan.cloud.points_mm
    plainly = replace(settings, outlier_threshold_mm=None)
    plain = register(points, model, start=start, method="dissertation", settings=plainly)
    eliminated = plain
    if settings.outlier_threshold_mm is not None:
        # The elimination starts where the plain run ended, as it does inside the method.
        going_on = replace(settings, suppression_runs=0)
        eliminated = register(points, model, start=plain.model_from_scanner, method="dissertation", settings=going_on)
    robust = register(points, model, start=start, covariance=scan.cloud.covariance_mm2, grid=scan.cloud.grid)
    return Matched(plain, eliminated, robust)


def least_squares_deg(scan: BenchScan, model: Model, truth: np.ndarray, share: float, size_mm: float) -> float:
    """Standard deviation of the rotation that unweighted least squares has when a share of the points is so noisy."""
    closest = model.closest(transform(truth, scan.cloud.points_mm))
    rows = plane_rows(closest.points, closest.normals, closest.points.mean(axis=0))
    bread = np.linalg.inv(rows.T @ rows)
    variance = float(np.var(closest.signed_mm)) + share * size_mm**2
    return float(np.degrees(np.sqrt(variance * np.trace(bread[:3, :3]))))


def clinical_noise(scan: BenchScan, share: float, size_mm: float, seed: int) -> np.ndarray:
    """Gaussian noise of `size_mm` on a random share of the points (sections 3.4.2 and 4.3.1)."""
    rng = np.random.default_rng(seed)
    points = scan.cloud.points_mm.copy()
    hit = rng.permutation(len(points))[: round(share * len(points))]
    points[hit] += rng.normal(0.0, size_mm, (len(hit), 3))
    return points


def without_rim(scan: BenchScan, axis: np.ndarray, centre: np.ndarray, share: float) -> np.ndarray:
    """Points (N,) that are left when a share is taken away from the rim inwards (section 4.3.2)."""
    offset = scan.in_model() - centre
    lateral = np.linalg.norm(offset - np.outer(offset @ axis, axis), axis=1)
    return np.asarray(lateral <= np.quantile(lateral, 1.0 - share))
