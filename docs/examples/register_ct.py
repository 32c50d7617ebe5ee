"""Register the surface of a CT volume to a model's signed distance field, by the solvers that register laser scans.

A made-up CT of the shipped hip bone stands in for a real one: bone and soft tissue, voxels filled in part, blur and
noise, in a frame of its own. Run it from the folder of the repository::

    python docs/examples/register_ct.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from picoradar.registration import Model, load_model, pose_error, register
from picoradar.registration.classic import lm_icp
from picoradar.registration.model import Surface, build_fields
from picoradar.registration.preoperative import surface_points
from picoradar.registration.se3 import inverse, pose, rotation_from_vector, transform

HIP = Path(__file__).parents[2] / "sim" / "data" / "hip_right.stl"
SOFT_HU, BONE_HU, NOISE_HU = 60.0, 900.0, 60.0


def made_up_ct(
    model: Model, middle: np.ndarray, *, voxel_mm: float = 1.5, size: int = 54, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A cube of CT about `middle` (3,) of the model: volume, affine (to the CT's mm), true `model_from_ct`."""
    rng = np.random.default_rng(seed)
    model_from_ct = pose(rotation_from_vector(rng.normal(size=3)), np.zeros(3))
    model_from_ct[:3, 3] = middle
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = -voxel_mm * (size - 1) / 2.0
    index = np.stack(np.meshgrid(*[np.arange(size)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = transform(model_from_ct, index * voxel_mm + affine[:3, 3])
    inside = np.clip(0.5 - model.closest(places).signed_mm / (1.5 * voxel_mm), 0.0, 1.0)
    intensity = SOFT_HU + (BONE_HU - SOFT_HU) * inside + rng.normal(0.0, NOISE_HU, len(places))
    return intensity.reshape(size, size, size), affine, model_from_ct


def seen_from(points: np.ndarray, origin: np.ndarray, pixel_mm: float) -> np.ndarray:
    """Points (N,) that a scanner at `origin` would see first, by a picture of their distances."""
    offset = points - origin
    distance = np.linalg.norm(offset, axis=1)
    forward = offset.mean(axis=0) / np.linalg.norm(offset.mean(axis=0))
    across = np.linalg.svd(forward[None])[2][1:]
    scale = distance.mean() / pixel_mm
    column, row = np.round(scale * (offset @ across.T) / (offset @ forward)[:, None]).astype(int).T
    pixel = (row - row.min()) * (np.ptp(column) + 1) + column - column.min()
    nearest = np.full(pixel.max() + 1, np.inf)
    np.minimum.at(nearest, pixel, distance)
    return np.asarray(distance <= nearest[pixel] + pixel_mm)


def by_distance_field(points: np.ndarray, surface: Surface, start: np.ndarray) -> np.ndarray:
    """Levenberg-Marquardt on the signed distances of all surface points (LM-ICP), from a rough start."""
    near = transform(start, points)
    field, _ = build_fields(surface, near.min(axis=0) - 8.0, near.max(axis=0) + 8.0, step_mm=2.0)
    return lm_icp(points, field, start)


def by_front_door(points: np.ndarray, model: Model, start: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """The robust method on the points that a scanner 900 mm away along `towards` (3,), CT frame, would see."""
    origin = points.mean(axis=0) + 900.0 * towards
    visible = points[seen_from(points, origin, pixel_mm=2.0)]
    return register(visible, model, start=start, origin=origin).model_from_scanner


def main() -> None:
    model = load_model(HIP)
    socket = model.views[0]
    volume, affine, truth = made_up_ct(model, socket.centre)
    points = surface_points(volume, affine)
    off = pose(rotation_from_vector(np.radians([6.0, -5.0, 6.0])), np.array([4.0, -5.0, 5.0]))
    start = pose(np.eye(3), socket.centre) @ off @ pose(np.eye(3), -socket.centre) @ truth
    towards = inverse(start)[:3, :3] @ socket.axis
    sys.stdout.write(f"{len(points)} surface points from {volume.size} voxels\n")
    for name, found in {
        "start": start,
        "distance field": by_distance_field(points, model.surface, start),
        "front door": by_front_door(points, model, start, towards),
    }.items():
        error = pose_error(found, truth, socket.centre)
        sys.stdout.write(f"{name}: {error.rotation_deg:.2f} deg, {error.translation_mm:.2f} mm\n")


if __name__ == "__main__":
    main()
