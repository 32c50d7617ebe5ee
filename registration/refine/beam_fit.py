"""The exact finish: every beam is cast on the model, and what it should have measured is compared with what it did.

The range along the beam is what carries the noise, so its residual is the maximum-likelihood one. Residuals to the
closest points are not: noise moves a point along a steep wall (fossa, notch, rim), where the closest point is another
one, and the very points that hold the rotation are weighted by a wrong normal. On simulated scans with known bone
points that costs a factor of up to 1.8 in the error at the targets; cast beams reach the information bound.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picoradar.registration._types import BoolArray, Float32Array, FloatArray, IntArray, Neighbours
from picoradar.registration.least_squares import plane_rows, weighted_squares
from picoradar.registration.measures import Iteration, residual_measures
from picoradar.registration.model import Closest, Surface
from picoradar.registration.scan import NoiseModel, Scan, bone_probability, estimated_range_noise, log_likelihood
from picoradar.registration.se3 import orthonormalised, small_motion, transform

STRAY_SIGMA = 3.5
"""Residuals larger than this many sigma have no weight."""

REWEIGHTED_STEPS = 5
"""Weights and noise settle in so many steps on fixed tangent planes."""

SETTLED_MM = 0.002
"""They have settled when a step moves the points by less."""

RESTING_MM = 0.05
"""The finish ends when the points' root mean square motion is below this; the tangent planes then hold."""

RIDGE = np.array([25.0, 25.0, 25.0, 0.04, 0.04, 0.04])
"""A step is a priori within 0.2 rad and 5 mm: motions that the surface leaves free stay where they are."""

MAX_CASTS = 6
"""Times at most that the beams are cast."""

FACING = 0.05
"""Smallest cosine between beam and normal of a point that can have been seen."""

INSIDE_MM = 10.0
"""Residual that stands for "this cannot be"."""

BESIDE_MM = 5.0
"""Residual that stands for "no bone that is known"."""

STEEP = 0.1
"""Smallest cosine that a residual along the beam is stretched by."""


@dataclass(frozen=True)
class Final:
    """The final pose with the places where the beams meet the model.

    Attributes
    ----------
    model_from_scanner : (4, 4) array
    met : Closest
        Where the beams meet the model; signed distances are those of the points from the tangent planes there. Beams
        that miss it have face -1, see :meth:`closest`.
    inliers : (N,) array of bool
    noise : NoiseModel
        Given, or as the residuals show it.
    history : list of Iteration
        Residuals of the bone points, step by step.
    log_likelihood : float
        Mean a point; minus infinity when too few points are left.
    """

    model_from_scanner: FloatArray
    met: Closest
    inliers: BoolArray
    noise: NoiseModel
    history: list[Iteration]
    log_likelihood: float

    def closest(self, scan: Scan, surface: Surface) -> Closest:
        """Where the beams meet the model, and the closest points of those that miss it.

        A beam that passes by the model ended outside it, whatever the sign of the distance to an open model's border.
        """
        met = self.met
        beside = np.flatnonzero(met.faces < 0)
        if len(beside) == 0:
            return met
        near = surface.closest(transform(self.model_from_scanner, scan.points[beside]))
        outwards = np.where(near.signed_mm < 0.0, -1.0, 1.0)
        found = Closest(met.points.copy(), met.normals.copy(), met.signed_mm.copy(), met.faces.copy())
        found.points[beside], found.normals[beside] = near.points, near.normals * outwards[:, None]
        found.signed_mm[beside], found.faces[beside] = near.signed_mm * outwards, near.faces
        return found


def exact_finish(
    scan: Scan,
    surface: Surface,
    start: FloatArray,
    noise: NoiseModel,
    around: Neighbours,
    allowed: BoolArray,
    *,
    noise_known: bool = False,
) -> Final:
    """Step from `start` (4, 4) until the points rest.

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
    allowed : (N,) array of bool
        Points that may take part.
    noise_known : bool
        Keep the range noise instead of estimating it from the residuals.
    """
    solution, history = start, list[Iteration]()
    tangent = _Tangent.at(scan, surface, solution, allowed)
    for cast in range(1, MAX_CASTS + 1):
        x = np.zeros(6)
        for _ in range(REWEIGHTED_STEPS):
            residual = tangent.residual(x)
            sigma = noise.plane_sigma(scan, solution[:3, :3], tangent.normals)
            bone, inliers = tangent.bone(residual, sigma, around)
            if inliers.sum() < 6:
                return Final(solution, tangent.met(residual), inliers, noise, history, -np.inf)
            if not noise_known:
                along = (residual * tangent.stretch)[inliers & (tangent.cosine > 0.5)]
                noise = replace(noise, range_mm=estimated_range_noise(along, noise.range_mm))
            measures = residual_measures(residual[inliers])
            history.append(Iteration("exact", measures.rms_mm, measures.mean_mm, measures.max_mm, int(inliers.sum())))
            before, x = x, tangent.solve(bone * inliers / sigma**2)
            if tangent.motion_mm(x - before) < SETTLED_MM:
                break
        solution = orthonormalised(small_motion(x, tangent.centre) @ solution)
        if tangent.motion_mm(x) < RESTING_MM or cast == MAX_CASTS:
            break
        del tangent  # of a large cloud there is no room for two
        tangent = _Tangent.at(scan, surface, solution, allowed)
    residual = tangent.residual(x)
    sigma = noise.plane_sigma(scan, solution[:3, :3], tangent.normals)
    _, inliers = tangent.bone(residual, sigma, around)
    likelihood = tangent.likelihood(residual, sigma, around)
    return Final(solution, tangent.met(residual), inliers, noise, history, likelihood)


@dataclass(frozen=True)
class _Tangent:
    """Tangent planes where the beams of one pose meet the model: residuals are linear in the motion there."""

    hits: FloatArray
    centre: FloatArray
    moments: FloatArray
    faces: IntArray
    normals: FloatArray
    signed_mm: FloatArray
    rows: FloatArray
    cosine: FloatArray
    stretch: FloatArray
    usable: BoolArray
    open_model: bool

    @classmethod
    def at(cls, scan: Scan, surface: Surface, solution: FloatArray, allowed: BoolArray) -> _Tangent:
        beams = scan.beams @ solution[:3, :3].T
        origin = transform(solution, scan.origin[None])
        faces, distance = surface.cast(np.broadcast_to(origin, beams.shape), beams)
        normals = surface.face_normals[faces]
        cosine = -np.einsum("ij,ij->i", normals, beams)
        faces[cosine <= 0.0] = -1  # only of an open model can a beam meet the back, where there is no surface
        hit = faces >= 0
        ahead = np.where(hit, distance - scan.ranges, 0.0)
        hits = beams
        hits *= (scan.ranges + ahead)[:, None]
        hits += origin
        centre = np.asarray(hits.mean(axis=0), dtype=np.float64)
        rows = plane_rows(hits, normals, centre)
        moments = hits.T @ (hits - centre) / len(hits)
        stretch = 1.0 / np.maximum(cosine, STEEP)
        usable = allowed & hit & (cosine > FACING)
        opened = bool(surface.border.any())
        return cls(hits, centre, moments, faces, normals, ahead * cosine, rows, cosine, stretch, usable, opened)

    def residual(self, x: FloatArray) -> FloatArray:
        """Plane residuals (N,) after the motion `x` (6,)."""
        return np.asarray(self.signed_mm + self.rows @ x, dtype=np.float64)

    def bone(self, residual: FloatArray, sigma: FloatArray, around: Neighbours) -> tuple[FloatArray, BoolArray]:
        """Probability of bone (N,), and the points that count as it."""
        probability = bone_probability(self._along(residual), self._along(sigma), around) * self.usable
        return probability, (probability > 0.5) & (np.abs(residual) < STRAY_SIGMA * sigma)

    def _along(self, values: FloatArray) -> Float32Array:
        """Lengths (N,) across the tangent planes taken along the beams: single precision tells bone from tissue."""
        return (values * self.stretch).astype(np.float32)

    def likelihood(self, residual: FloatArray, sigma: FloatArray, around: Neighbours) -> float:
        """Mean log likelihood a point.

        A beam that misses a closed model, or grazes it, cannot be; one that passes by an open model ended on what the
        model lacks, which is as likely as tissue.
        """
        along = np.where(self.usable, self._along(residual), np.float32(-INSIDE_MM))
        if self.open_model:
            along[self.faces < 0] = BESIDE_MM
        return float(log_likelihood(along, self._along(sigma), around).mean(dtype=np.float64))

    def motion_mm(self, x: FloatArray) -> float:
        """Root mean square shift of the points by the motion `x` (6,): of their second moments, for it is linear."""
        turn, shift = x[:3], x[3:]
        square = np.trace(self.moments) * (turn @ turn) - turn @ self.moments @ turn + shift @ shift
        return float(np.sqrt(max(0.0, square)))

    def solve(self, weight: FloatArray) -> FloatArray:
        """Weighted least-squares motion (6,)."""
        normal = weighted_squares(self.rows, weight) + np.diag(RIDGE)
        return np.asarray(-np.linalg.solve(normal, self.rows.T @ (weight * self.signed_mm)))

    def met(self, residual: FloatArray) -> Closest:
        """Where the beams meet the model, with residuals (N,); made of this plane's own arrays."""
        return Closest(self.hits, self.normals, residual, self.faces)
