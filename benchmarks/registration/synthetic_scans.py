"""Seeded scans of a socket by ray casting, without an instrument: noise along the beam, clumps of tissue in front."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration import Model
from picoradar.registration.se3 import inverse, pose, rotation_from_vector, transform

NOISE_MM = 0.4
"""Standard deviation of one range averaged over 8 sweeps."""

WINDOW_MM = 33.0
"""Radius of the disc that is scanned about the socket's axis."""

COVERAGE = 0.71
"""Share of the disc that is seen (section 5.3 of the dissertation); the rest is cut away along a line."""


@dataclass(frozen=True)
class Synthetic:
    """Points (N, 3) in the scanner frame, true pose (4, 4), height of tissue (N,) in mm, raster places (N, 2)."""

    points: np.ndarray
    truth: np.ndarray
    height_mm: np.ndarray
    grid: np.ndarray


def facing_pose(axis: np.ndarray, centre: np.ndarray, rng: np.random.Generator, distance_mm: float) -> np.ndarray:
    """A pose `model_from_scanner` that looks into a socket with up to 15 deg of tilt, any roll and 2 mm of bad aim."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    basis = np.stack([u, np.cross(-axis, u), -axis], axis=1)  # columns: scanner's axes in the model frame, unturned
    tilt, heading, roll = np.radians(rng.uniform(0.0, 15.0)), *rng.uniform(-np.pi, np.pi, 2)
    turn = rotation_from_vector(tilt * np.array([np.cos(heading), np.sin(heading), 0.0]))
    rotation = basis @ turn @ rotation_from_vector(np.array([0.0, 0.0, roll]))
    aim = basis[:, :2] @ rng.uniform(-2.0, 2.0, 2)
    return pose(rotation, centre + aim - distance_mm * rotation[:, 2])


def scan(
    model: Model,
    centre: np.ndarray,
    axis: np.ndarray,
    seed: int,
    *,
    tissue: float,
    step_mm: float = 1.05,
    noise_mm: float = NOISE_MM,
    coverage: float = COVERAGE,
) -> Synthetic:
    """Scan the socket at `centre` that opens along `axis` (model frame), with a share `tissue` of it covered."""
    rng = np.random.default_rng([seed, round(100 * tissue)])
    distance = rng.uniform(850.0, 900.0)
    truth = facing_pose(axis, centre, rng, distance)
    count = int(WINDOW_MM / step_mm)
    rows, columns = (a.ravel() for a in np.mgrid[-count : count + 1, -count : count + 1])
    inside = np.hypot(rows, columns) * step_mm <= WINDOW_MM
    rows, columns = rows[inside], columns[inside]
    beams = np.stack([columns * step_mm / distance, rows * step_mm / distance, np.ones(len(rows))], axis=1)
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    origins = np.broadcast_to(truth[:3, 3], beams.shape)
    ranges = model.surface.first_hit(origins, beams @ truth[:3, :3].T)
    angle = rng.uniform(-np.pi, np.pi)
    across = (columns * np.cos(angle) + rows * np.sin(angle)) * step_mm
    seen = np.isfinite(ranges) & (across <= np.quantile(across[np.isfinite(ranges)], coverage))
    clean = beams[seen] * ranges[seen, None]
    height = clumps(clean, tissue, rng)
    noisy = clean - beams[seen] * (height + rng.normal(0.0, noise_mm, len(clean)))[:, None]
    return Synthetic(noisy, truth, height, np.stack([rows[seen], columns[seen]], axis=1))


def clumps(points: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Heights (N,) in mm of clumps of tissue, 2 to 9 mm high, on a share of the points."""
    height = np.zeros(len(points))
    while (height > 0).mean() < share:
        middle, width, top = points[rng.integers(len(points))], rng.uniform(3.0, 8.0), rng.uniform(2.0, 9.3)
        q = np.linalg.norm(points - middle, axis=1) / width
        height = np.maximum(height, np.where(q < 1, 1.0 + (top - 1.0) * np.clip(1 - q * q, 0, 1) ** 0.7, 0.0))
    return height


def start_off(truth: np.ndarray, points: np.ndarray, angle_deg: float, shift_mm: float, seed: int) -> np.ndarray:
    """A start of exactly this rotation and shift from the true pose, about the middle of the points."""
    rng = np.random.default_rng([seed, 77])
    axis, direction = rng.normal(size=(2, 3))
    rotation = rotation_from_vector(np.radians(angle_deg) * axis / np.linalg.norm(axis))
    centre = transform(truth, points).mean(axis=0)
    return pose(rotation, centre - rotation @ centre + shift_mm * direction / np.linalg.norm(direction)) @ truth


def turned(points: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points in a frame of their own, and ``old_from_new``: no program can know the frame."""
    rng = np.random.default_rng([seed, 78])
    new_from_old = pose(rotation_from_vector(rng.normal(size=3)), rng.normal(size=3) * 100.0)
    return transform(new_from_old, points), inverse(new_from_old)
