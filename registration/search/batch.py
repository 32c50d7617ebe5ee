"""Many poses at once: residuals along the beams on a distance field, and damped Gauss-Newton steps for all of them.

Arrays are float32 and laid out coordinate by coordinate, (3, K, M) for K poses and M points, in a frame about the
view's centre, so that one pass over memory serves all poses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import Float32Array, FloatArray, IntArray
from picoradar.registration.model import DistanceField
from picoradar.registration.se3 import rotation_from_vector

BLOCK = 16_000
"""Field values worked on at once: few enough to stay in the cache, and in memory that need not be fetched anew."""

GRAZING = np.float32(0.25)
"""Smallest cosine between beam and normal that a residual along the beam is stretched by."""

AWAY = np.float32(-0.5)
"""Cosine below which a surface faces away; on edges a field's normal may lean to either side."""

CAST_MM = np.float32(4.0)
"""Farthest that a beam is followed on a field."""

RIDGE = np.array([0.04, 0.04, 0.04, 1e-4, 1e-4, 1e-4])
"""Stiffness a point (rad^-2, mm^-2) that holds motions which the surface leaves free; too small to slow others."""

MAX_TURN_RAD = 0.2
"""Largest rotation of one step."""


@dataclass(frozen=True)
class Poses:
    """K poses from a scanner frame about the cloud's centre to the model frame about the view's centre.

    Attributes
    ----------
    rotations : (K, 3, 3) array of float32
    shifts : (K, 3) array of float32
        mm.
    """

    rotations: Float32Array
    shifts: Float32Array

    def __len__(self) -> int:
        return len(self.rotations)

    def at(self, index: IntArray | slice) -> Poses:
        """Pick some of the poses."""
        return Poses(self.rotations[index], self.shifts[index])

    def blocks(self, points: int) -> Iterator[Poses]:
        """The poses in turn, so many at a time that with so many points each they make up a `BLOCK`."""
        at_once = max(1, BLOCK // points)
        for first in range(0, len(self), at_once):
            yield self.at(slice(first, first + at_once))


@dataclass(frozen=True)
class Sampled:
    """Field values of M points under K poses.

    Attributes
    ----------
    moved : (3, K, M) array
        Points in the view's frame, mm.
    beams : (3, K, M) array
        Directions of the beams in the view's frame.
    distance : (K, M) array
        Signed, mm.
    gradient : (K, M, 3) array
    cosine : (K, M) array
        Between the beam, reversed, and the surface normal; negative where the surface faces away.
    """

    moved: Float32Array
    beams: Float32Array
    distance: Float32Array
    gradient: Float32Array
    cosine: Float32Array

    def along_beam(self) -> Float32Array:
        """Residuals along the beams (K, M) mm: how far in front of bone (+) or inside it (-) each beam ended."""
        return np.asarray(self.distance / np.maximum(self.cosine, GRAZING), dtype=np.float32)


def sample(field: DistanceField, poses: Poses, points: Float32Array, beams: Float32Array) -> Sampled:
    """Evaluate a field at `points` (3, M) with `beams` (3, M) under all poses."""
    count = len(poses)
    stacked = poses.rotations.transpose(1, 0, 2).reshape(3 * count, 3)
    moved = (stacked @ points).reshape(3, count, -1)
    moved += poses.shifts.T[:, :, None]
    turned = (stacked @ beams).reshape(3, count, -1)
    return _sampled(field, moved, turned)


def cast(field: DistanceField, found: Sampled) -> Sampled:
    """Follow the beams from `found` to the surface, one Newton step on the field: what a cast beam would have met.

    The distances of the result are those of the measured points from the tangent planes where the beams meet bone.
    """
    ahead = np.clip(found.along_beam(), -CAST_MM, CAST_MM)
    met = _sampled(field, found.moved + found.beams * ahead, found.beams)
    distance = met.distance + ahead * np.maximum(met.cosine, GRAZING)
    return Sampled(met.moved, met.beams, distance, met.gradient, met.cosine)


def _sampled(field: DistanceField, moved: Float32Array, beams: Float32Array) -> Sampled:
    distance, gradient = field.sample(moved)
    cosine = beams[0] * gradient[..., 0]
    cosine += beams[1] * gradient[..., 1]
    cosine += beams[2] * gradient[..., 2]
    np.negative(cosine, out=cosine)
    return Sampled(moved, beams, distance, gradient, cosine)


def one_sided(residuals: Float32Array, scale_mm: float, inside: float) -> tuple[Float32Array, Float32Array]:
    """One-sided Welsch loss: a point in front of bone may be tissue, a point inside bone may not be anything.

    ``rho(r) = c (1 - exp(-(r/s)^2 / c))`` with c = 1 in front of bone and c = `inside` within it.

    Returns
    -------
    loss, weight : (K, M) arrays
        ``weight = rho'(r) s^2 / (2 r)``.
    """
    z = residuals * np.float32(1.0 / scale_mm)
    cap = np.where(z > 0, np.float32(1.0), np.float32(inside))
    z *= z
    z /= cap
    np.negative(z, out=z)
    weight = np.exp(z)
    loss = (np.float32(1.0) - weight) * cap
    return loss, weight


def scores(
    field: DistanceField, poses: Poses, points: Float32Array, beams: Float32Array, scale_mm: float, inside: float
) -> Float32Array:
    """Mean one-sided loss (K,) a point; a point on a surface that faces away counts as inside."""
    mean = []
    for some in poses.blocks(points.shape[1]):
        found = sample(field, some, points, beams)
        loss, _ = one_sided(found.along_beam(), scale_mm, inside)
        loss[found.cosine <= AWAY] = inside
        mean.append(loss.mean(axis=1))
    return np.concatenate(mean)


def descended(
    field: DistanceField, poses: Poses, points: Float32Array, beams: Float32Array, scale_mm: float, inside: float
) -> Poses:
    """Poses after one step each under the one-sided loss of the residuals along the beams."""
    stepped = []
    for some in poses.blocks(points.shape[1]):
        found = sample(field, some, points, beams)
        _, weight = one_sided(found.along_beam(), scale_mm, inside)
        stepped.append(step(some, found, beam_weights(found, weight)))
    return Poses(np.concatenate([s.rotations for s in stepped]), np.concatenate([s.shifts for s in stepped]))


def beam_weights(found: Sampled, weight: Float32Array) -> Float32Array:
    """Turn weights of squared residuals along the beam into weights of squared plane residuals."""
    cosine = np.maximum(found.cosine, GRAZING)
    weight = weight / (cosine * cosine)
    weight[found.cosine <= 0] = 0.0
    return weight


def step(poses: Poses, found: Sampled, weights: Float32Array, damping: float = 1e-3) -> Poses:
    """One damped Gauss-Newton step of every pose on the plane residuals ``n . (p - c)``.

    Parameters
    ----------
    poses : Poses
    found : Sampled
        At these poses.
    weights : (K, M) array
        Of the squared plane residuals.
    damping : float
        Levenberg-Marquardt's, relative to the diagonal of the normal matrix.
    """
    x, y, z = found.moved
    n0, n1, n2 = (found.gradient[..., k] for k in range(3))
    count, size = found.distance.shape
    rows = np.empty((count, 8, size), dtype=np.float32)  # the last is for width alone: products of eight are faster
    rows[:, 3], rows[:, 4], rows[:, 5], rows[:, 6], rows[:, 7] = n0, n1, n2, found.distance, 0.0
    n0, n1, n2 = rows[:, 3], rows[:, 4], rows[:, 5]
    for k, (a, b, c, d) in enumerate(((y, n2, z, n1), (z, n0, x, n2), (x, n1, y, n0))):
        np.multiply(a, b, out=rows[:, k])
        rows[:, k] -= c * d
    rows *= np.sqrt(weights)[:, None, :]
    normal = np.matmul(rows, rows.transpose(0, 2, 1)).astype(np.float64)
    matrix, right = normal[:, :6, :6].copy(), normal[:, :6, 6]
    diagonal = np.einsum("kii->ki", matrix)
    diagonal += damping * diagonal + size * RIDGE
    motion = -np.linalg.solve(matrix, right[..., None])[..., 0]
    turn = np.linalg.norm(motion[:, :3], axis=1)
    motion *= np.minimum(1.0, MAX_TURN_RAD / np.maximum(turn, 1e-12))[:, None]
    return _moved(poses, motion)


def _moved(poses: Poses, motion: FloatArray) -> Poses:
    rotation = rotation_from_vector(motion[:, :3]).astype(np.float32)
    shifts = (rotation @ poses.shifts[..., None])[..., 0] + motion[:, 3:].astype(np.float32)
    return Poses(rotation @ poses.rotations, shifts)
