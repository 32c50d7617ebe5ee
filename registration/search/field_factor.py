"""The point-to-field factor of many poses at once: residuals along the beams, and damped Gauss-Newton steps for all.

Arrays are float32 and laid out coordinate by coordinate, (3, K, M) for K poses and M points, in a frame about the
view's centre, so that one pass over memory serves all poses. Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import Float32Array, FloatArray, IntArray
from picoradar.registration.least_squares import damped_step
from picoradar.registration.model import DistanceField
from picoradar.registration.se3 import rotation_from_vector
from picoradar.registration.settings import StepSettings

BLOCK = 16_000
"""Field values worked on at once: few enough to stay in the cache, and in memory that need not be fetched anew."""


@dataclass(frozen=True)
class Beams:
    """M measured points and the directions of their beams, coordinate by coordinate.

    Attributes
    ----------
    points : (3, M) array of float32
        About the cloud's centre, scanner axes, mm.
    directions : (3, M) array of float32
        Unit vectors from the scanner.
    """

    points: Float32Array
    directions: Float32Array

    @classmethod
    def of(cls, points: FloatArray, directions: FloatArray) -> Beams:
        """Beams of points (M, 3) and directions (M, 3)."""
        return cls(
            np.ascontiguousarray(points.T, dtype=np.float32), np.ascontiguousarray(directions.T, dtype=np.float32)
        )

    def __len__(self) -> int:
        return int(self.points.shape[1])

    def first(self, count: int) -> Beams:
        """The first `count` of them."""
        return Beams(np.ascontiguousarray(self.points[:, :count]), np.ascontiguousarray(self.directions[:, :count]))


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
    min_cosine : float
        Smallest cosine that a residual along the beam is stretched by.
    """

    moved: Float32Array
    beams: Float32Array
    distance: Float32Array
    gradient: Float32Array
    cosine: Float32Array
    min_cosine: float

    def along_beam(self) -> Float32Array:
        """Residuals along the beams (K, M) mm [eq. 1]: how far in front of bone (+) or inside it (-) each one ended."""
        return np.asarray(self.distance / np.maximum(self.cosine, np.float32(self.min_cosine)), dtype=np.float32)


@dataclass(frozen=True)
class OneSidedLoss:
    """One-sided Welsch loss [eq. 5]: a point in front of bone may be tissue, a point inside bone may not be anything.

    ``rho(r) = c (1 - exp(-(r/s)^2 / c))`` with c = 1 in front of bone and c = `inside` within it.

    Attributes
    ----------
    scale_mm : float
        s.
    inside : float
    """

    scale_mm: float
    inside: float

    def of(self, residuals: Float32Array) -> tuple[Float32Array, Float32Array]:
        """Losses and weights ``rho'(r) s^2 / (2 r)`` of residuals, all (K, M)."""
        z = residuals * np.float32(1.0 / self.scale_mm)
        cap = np.where(z > 0, np.float32(1.0), np.float32(self.inside))
        z *= z
        z /= cap
        np.negative(z, out=z)
        weight = np.exp(z)
        loss = (np.float32(1.0) - weight) * cap
        return loss, weight


def sample(field: DistanceField, poses: Poses, beams: Beams, settings: StepSettings) -> Sampled:
    """Evaluate a field at the points of `beams` under all poses."""
    count = len(poses)
    stacked = poses.rotations.transpose(1, 0, 2).reshape(3 * count, 3)
    moved = (stacked @ beams.points).reshape(3, count, -1)
    moved += poses.shifts.T[:, :, None]
    turned = (stacked @ beams.directions).reshape(3, count, -1)
    return _sampled(field, moved, turned, settings.stretch_min_cosine)


def cast(field: DistanceField, found: Sampled, settings: StepSettings) -> Sampled:
    """Follow the beams from `found` to the surface, one Newton step on the field: what a cast beam would have met.

    The distances of the result are those of the measured points from the tangent planes where the beams meet bone.
    """
    farthest = np.float32(settings.max_cast_mm)
    ahead = np.clip(found.along_beam(), -farthest, farthest)
    met = _sampled(field, found.moved + found.beams * ahead, found.beams, found.min_cosine)
    distance = met.distance + ahead * np.maximum(met.cosine, np.float32(found.min_cosine))
    return Sampled(met.moved, met.beams, distance, met.gradient, met.cosine, found.min_cosine)


def _sampled(field: DistanceField, moved: Float32Array, beams: Float32Array, min_cosine: float) -> Sampled:
    distance, gradient = field.sample(moved)
    cosine = beams[0] * gradient[..., 0]
    cosine += beams[1] * gradient[..., 1]
    cosine += beams[2] * gradient[..., 2]
    np.negative(cosine, out=cosine)
    return Sampled(moved, beams, distance, gradient, cosine, min_cosine)


def scores(
    field: DistanceField, poses: Poses, beams: Beams, loss: OneSidedLoss, settings: StepSettings
) -> Float32Array:
    """Mean one-sided loss (K,) a point; a point on a surface that faces away counts as inside."""
    mean = []
    for some in poses.blocks(len(beams)):
        found = sample(field, some, beams, settings)
        losses, _ = loss.of(found.along_beam())
        losses[found.cosine <= np.float32(settings.facing_away_cosine)] = loss.inside
        mean.append(losses.mean(axis=1))
    return np.concatenate(mean)


def descended(field: DistanceField, poses: Poses, beams: Beams, loss: OneSidedLoss, settings: StepSettings) -> Poses:
    """Poses after one step each under the one-sided loss of the residuals along the beams."""
    stepped = []
    for some in poses.blocks(len(beams)):
        found = sample(field, some, beams, settings)
        _, weight = loss.of(found.along_beam())
        stepped.append(step(some, found, beam_weights(found, weight), settings, settings.damping))
    return Poses(np.concatenate([s.rotations for s in stepped]), np.concatenate([s.shifts for s in stepped]))


def beam_weights(found: Sampled, weight: Float32Array) -> Float32Array:
    """Turn weights of squared residuals along the beam into weights of squared plane residuals."""
    cosine = np.maximum(found.cosine, np.float32(found.min_cosine))
    weight = weight / (cosine * cosine)
    weight[found.cosine <= 0] = 0.0
    return weight


def step(poses: Poses, found: Sampled, weights: Float32Array, settings: StepSettings, damping: float) -> Poses:
    """One damped Gauss-Newton step [eq. 9] of every pose on the plane residuals ``n . (p - c)``.

    Parameters
    ----------
    poses : Poses
    found : Sampled
        At these poses.
    weights : (K, M) array
        Of the squared plane residuals.
    settings : StepSettings
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
    per_rad2, per_mm2 = settings.ridge_per_rad2, settings.ridge_per_mm2
    ridge = size * np.array((per_rad2, per_rad2, per_rad2, per_mm2, per_mm2, per_mm2))
    motion = damped_step(normal[:, :6, :6], normal[:, :6, 6], ridge, damping)
    turn = np.linalg.norm(motion[:, :3], axis=1)
    motion *= np.minimum(1.0, settings.max_turn_rad / np.maximum(turn, np.finfo(np.float64).tiny))[:, None]
    return _moved(poses, motion)


def _moved(poses: Poses, motion: FloatArray) -> Poses:
    rotation = rotation_from_vector(motion[:, :3]).astype(np.float32)
    shifts = (rotation @ poses.shifts[..., None])[..., 0] + motion[:, 3:].astype(np.float32)
    return Poses(rotation @ poses.rotations, shifts)
