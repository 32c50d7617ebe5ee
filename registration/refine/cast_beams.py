"""The cast-beam factor: what each beam should have measured at a pose, against what it did measure.

The range along the beam is what carries the noise, so its residual is the maximum-likelihood one. Residuals to the
closest points are not: noise moves a point along a steep wall (fossa, notch, rim), where the closest point is another
one, and the very points that hold the rotation are weighted by a wrong normal. On simulated scans with known bone
points that costs a factor of up to 1.8 in the error at the targets; cast beams reach the information bound.

Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import BoolArray, Float32Array, FloatArray, IntArray, Neighbours
from picoradar.registration.least_squares import damped_step, plane_rows, weighted_squares
from picoradar.registration.model import Closest, Surface
from picoradar.registration.scan import Scan, bone_probability, log_likelihood, observed_share
from picoradar.registration.se3 import transform
from picoradar.registration.settings import BeamFitSettings, TissueSettings


@dataclass(frozen=True)
class CastBeams:
    """Beams of a scan cast on a model at one pose; residuals are linear in the motion on the tangent planes there.

    Attributes
    ----------
    hits : (N, 3) array
        Where the beams meet the model, mm; the measured points where they meet nothing.
    centre : (3,) array
        Mean of the hits, that a small motion turns about.
    moments : (3, 3) array
        Mean second moments of the hits about it, mm^2.
    faces : (N,) array of int
        Faces met; -1 for none.
    normals : (N, 3) array
    signed_mm : (N,) array
        Residuals e [eq. 1] across the tangent planes.
    rows : (N, 6) array
        Their derivatives g [eq. 2].
    cosine : (N,) array
        Between the beam, reversed, and the normal.
    stretch : (N,) array
        Length along the beam of a unit of length across the tangent plane.
    usable : (N,) array of bool
        Points that may take part: allowed, and on a surface that they can have been measured from.
    open_model : bool
        The model has a border, beyond which nothing is known.
    """

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
    settings: BeamFitSettings
    tissue: TissueSettings

    @classmethod
    def at(
        cls,
        scan: Scan,
        surface: Surface,
        model_from_scanner: FloatArray,
        allowed: BoolArray,
        settings: BeamFitSettings,
        tissue: TissueSettings,
    ) -> CastBeams:
        """Cast the beams of a scan at a pose (4, 4); points (N,) that are not `allowed` take no part."""
        beams = scan.beams @ model_from_scanner[:3, :3].T
        origin = transform(model_from_scanner, scan.origin[None])
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
        return cls(
            hits=hits,
            centre=centre,
            moments=hits.T @ (hits - centre) / len(hits),
            faces=faces,
            normals=normals,
            signed_mm=ahead * cosine,
            rows=plane_rows(hits, normals, centre),
            cosine=cosine,
            stretch=1.0 / np.maximum(cosine, settings.stretch_min_cosine),
            usable=allowed & hit & (cosine > settings.min_cosine),
            open_model=bool(surface.border.any()),
            settings=settings,
            tissue=tissue,
        )

    def residual(self, x: FloatArray) -> FloatArray:
        """Plane residuals (N,) after the motion `x` (6,) [eq. 2]."""
        return np.asarray(self.signed_mm + self.rows @ x, dtype=np.float64)

    def bone(self, residual: FloatArray, sigma: FloatArray, around: Neighbours) -> tuple[FloatArray, BoolArray]:
        """Probability of bone (N,) [eq. 4], and the points (N,) that count as it [eq. 8]."""
        along, sigma_along = self._along(residual), self._along(sigma)
        probability = bone_probability(along, sigma_along, around, self.tissue) * self.usable
        near = np.abs(residual) < self.settings.max_residual_sigma * sigma
        return probability, (probability > self.settings.min_bone_probability) & near

    def _along(self, values: FloatArray) -> Float32Array:
        """Lengths (N,) across the tangent planes taken along the beams: single precision tells bone from tissue."""
        return (values * self.stretch).astype(np.float32)

    def range_residuals(self, residual: FloatArray, inliers: BoolArray, min_count: int) -> FloatArray:
        """Residuals along the beams of the `inliers` (N,) that tell the range noise: those seen from in front.

        Of all inliers, where fewer than `min_count` are seen so.
        """
        facing = inliers & (self.cosine > self.settings.noise_min_cosine)
        return np.asarray((residual * self.stretch)[facing if facing.sum() >= min_count else inliers])

    def likelihood(self, residual: FloatArray, sigma: FloatArray, around: Neighbours) -> float:
        """Mean log likelihood a point [eq. 11].

        A beam that misses a closed model, or grazes it, cannot be; one that passes by an open model ended on what the
        model lacks, which is as likely as tissue.
        """
        along = np.where(self.usable, self._along(residual), np.float32(-self.tissue.residual_inside_mm))
        if self.open_model:
            along[self.faces < 0] = self.tissue.residual_outside_mm
        return float(log_likelihood(along, self._along(sigma), around, self.tissue).mean(dtype=np.float64))

    def observed(self, residual: FloatArray, sigma: FloatArray, around: Neighbours) -> FloatArray:
        """Weights (N,), 1/mm^2, of the rows in the information that the points carry, doubt about tissue included."""
        share = observed_share(self._along(residual), self._along(sigma), around, self.tissue)
        return np.asarray(share * self.usable / sigma**2, dtype=np.float64)

    def motion_mm(self, x: FloatArray) -> float:
        """Root mean square shift of the points by the motion `x` (6,): of their second moments, for it is linear."""
        turn, shift = x[:3], x[3:]
        square = np.trace(self.moments) * (turn @ turn) - turn @ self.moments @ turn + shift @ shift
        return float(np.sqrt(max(0.0, square)))

    def solved(self, weight: FloatArray, ridge: FloatArray) -> FloatArray:
        """Weighted least-squares motion (6,) from the pose of the cast [eq. 9]."""
        return damped_step(weighted_squares(self.rows, weight), self.rows.T @ (weight * self.signed_mm), ridge)

    def met(self, residual: FloatArray) -> Closest:
        """Where the beams meet the model, with residuals (N,); made of this cast's own arrays."""
        return Closest(self.hits, self.normals, residual, self.faces)
