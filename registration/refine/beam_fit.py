"""The beam fit: beams are cast on the model, and the pose is moved until they should have measured what they did.

Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray, Neighbours
from picoradar.registration.model import Closest, Surface
from picoradar.registration.refine.cast_beams import CastBeams
from picoradar.registration.scan import MIN_POINTS, NoiseModel, Scan, estimated_range_noise
from picoradar.registration.se3 import orthonormalised, small_motion, transform
from picoradar.registration.settings import BeamFitSettings, RobustSettings
from picoradar.registration.solution import Iteration, residual_measures


@dataclass(frozen=True)
class BeamFit:
    """The pose that the beams fit best, and where they meet the model there.

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
    observed : (N,) array or None
        Weight of each point in the information observed [eq. 10], 1/mm^2; None where too few points are left.
    """

    model_from_scanner: FloatArray
    met: Closest
    inliers: BoolArray
    noise: NoiseModel
    history: list[Iteration]
    log_likelihood: float
    observed: FloatArray | None = None

    def closest(self, scan: Scan, surface: Surface) -> Closest:
        """Where the beams meet the model, and the closest points of those that miss it.

        A beam that passes by the model ended outside it, whatever the sign of the distance to an open model's border.
        """
        met = self.met
        missed = np.flatnonzero(met.faces < 0)
        if len(missed) == 0:
            return met
        near = surface.closest(transform(self.model_from_scanner, scan.points[missed]))
        outwards = np.where(near.signed_mm < 0.0, -1.0, 1.0)
        found = Closest(met.points.copy(), met.normals.copy(), met.signed_mm.copy(), met.faces.copy())
        found.points[missed], found.normals[missed] = near.points, near.normals * outwards[:, None]
        found.signed_mm[missed], found.faces[missed] = near.signed_mm * outwards, near.faces
        return found


@dataclass(frozen=True)
class BeamFitter:
    """Fits poses of a scan to a model.

    Attributes
    ----------
    scan : Scan
    surface : Surface
        Of the whole model.
    noise : NoiseModel
        To begin with.
    around : (N, 8) array
        Raster neighbours.
    noise_known : bool
        Keep the range noise instead of estimating it from the residuals.
    settings : RobustSettings
    edges : bool
        Edges may hold the pose: steps are shortened until the beams that are cast from their ends agree that they are
        no worse. On smooth bone that costs time and changes nothing.
    """

    scan: Scan
    surface: Surface
    noise: NoiseModel
    around: Neighbours
    noise_known: bool
    settings: RobustSettings
    edges: bool = False

    def fit(self, start: FloatArray, allowed: BoolArray) -> BeamFit:
        """Step from `start` (4, 4) until the points rest; points (N,) that are not `allowed` take no part.

        With the bone points known, their noise is symmetric; the one-sided loss of the search would leave a bias.
        """
        s, stiffness = self.settings.beam_fit, ridge(self.settings.beam_fit)
        pose, noise, history = start, self.noise, list[Iteration]()
        beams = self._cast(pose, allowed)  # e, g [eq. 1, 2]
        for cast in range(1, s.max_casts + 1):
            x = np.zeros(6)
            for _ in range(s.max_reweighted_steps):
                residual = beams.residual(x)  # e + g x [eq. 2]
                sigma = noise.plane_sigma(self.scan, pose[:3, :3], beams.normals)  # [eq. 6]
                bone, inliers = beams.bone(residual, sigma, self.around)  # P [eq. 3, 4], u [eq. 8]
                if inliers.sum() < MIN_POINTS:
                    return BeamFit(pose, beams.met(residual), inliers, noise, history, -np.inf)
                noise = self._renewed(noise, beams, residual, inliers)
                history.append(_iteration(residual[inliers]))
                previous, x = x, beams.solved(bone * inliers / sigma**2, stiffness)  # w [eq. 8], x [eq. 9]
                if beams.motion_mm(x - previous) < s.settled_mm:
                    break
            if self.edges:
                x = self._shortened(x, beams, pose, noise, allowed)
            pose = orthonormalised(small_motion(x, beams.centre) @ pose)  # exp(x) T
            if beams.motion_mm(x) < s.resting_mm or cast == s.max_casts:
                break
            del beams  # of a large cloud there is no room for two
            beams = self._cast(pose, allowed)
        residual = beams.residual(x)
        sigma = noise.plane_sigma(self.scan, pose[:3, :3], beams.normals)
        _, inliers = beams.bone(residual, sigma, self.around)
        likelihood = beams.likelihood(residual, sigma, self.around)  # [eq. 11]
        observed = beams.observed(residual, sigma, self.around)
        return BeamFit(pose, beams.met(residual), inliers, noise, history, likelihood, observed)

    def likelihood_at(self, pose: FloatArray, noise: NoiseModel, allowed: BoolArray) -> float:
        """Mean log likelihood a point [eq. 11] of a pose (4, 4) as it is."""
        return self._likelihood(self._cast(pose, allowed), pose, noise)

    def _likelihood(self, beams: CastBeams, pose: FloatArray, noise: NoiseModel) -> float:
        sigma = noise.plane_sigma(self.scan, pose[:3, :3], beams.normals)
        return beams.likelihood(beams.signed_mm, sigma, self.around)

    def _shortened(
        self, x: FloatArray, beams: CastBeams, pose: FloatArray, noise: NoiseModel, allowed: BoolArray
    ) -> FloatArray:
        """The motion (6,), halved until its end is no less likely than where it begins; none if that takes too long.

        Tangent planes end at edges: beyond them a beam meets another face, or nothing, and a step that the planes call
        good may leave the minimum. (Backtracking: Nocedal, Wright, Numerical Optimization, 2006, section 3.1.)
        """
        here = self._likelihood(beams, pose, noise)
        for _ in range(self.settings.edges.max_halvings):
            if self.likelihood_at(small_motion(x, beams.centre) @ pose, noise, allowed) >= here:
                return x
            x = x / 2.0
        return np.zeros(6)

    def _renewed(self, noise: NoiseModel, beams: CastBeams, residual: FloatArray, inliers: BoolArray) -> NoiseModel:
        """The noise as residuals along the beam show it, where it is not known."""
        if self.noise_known:
            return noise
        settings = self.settings.noise
        along_beam_mm = beams.range_residuals(residual, inliers, settings.min_residuals)
        return replace(noise, range_mm=estimated_range_noise(along_beam_mm, noise.range_mm, settings))

    def _cast(self, pose: FloatArray, allowed: BoolArray) -> CastBeams:
        return CastBeams.at(self.scan, self.surface, pose, allowed, self.settings.beam_fit, self.settings.tissue)


def ridge(settings: BeamFitSettings) -> FloatArray:
    """Stiffness (6,) of the a priori step of nil."""
    by_rotation = 1.0 / settings.prior_rad / settings.prior_rad
    by_translation = 1.0 / settings.prior_mm / settings.prior_mm
    return np.array([by_rotation] * 3 + [by_translation] * 3)


def _iteration(residuals_mm: FloatArray) -> Iteration:
    measures = residual_measures(residuals_mm)
    return Iteration("beam fit", measures.rms_mm, measures.mean_mm, measures.max_mm, len(residuals_mm))
