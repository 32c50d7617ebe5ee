"""Echoes that are too weak for bone: films of blood, fat and torn tissue that their range alone cannot tell from noise.

Bone is the brightest thing in a wound at 904 nm. A film of blood a few tenths of a millimetre thick lies within the
noise of one range, but pulls the pose; it sends back a third of the light. What counts is the amplitude over what bone
would send back from there, in units of the points that are taken for bone: no calibration of the brightness is needed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.model import Model
from picoradar.registration.refine import BeamFitter, outside_regions
from picoradar.registration.robust.schedule import register_near
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import inverse, transform
from picoradar.registration.settings import BrightnessSettings, RobustSettings
from picoradar.registration.solution import Solution


def relative_brightness(
    scan: Scan, response_mv: FloatArray, solution: Solution, settings: BrightnessSettings
) -> FloatArray:
    """Amplitudes (N,) over what bone would send back at that range and incidence; the median inlier has 1."""
    beams = scan.beams @ solution.model_from_scanner[:3, :3].T
    cosine = np.clip(-np.einsum("ij,ij->i", solution.closest.normals, beams), 0.0, 1.0)
    ranges = np.linalg.norm(scan.points - scan.origin, axis=1)
    reflected = settings.grazing_share + (1.0 - settings.grazing_share) * cosine
    brightness = response_mv * ranges**2 / reflected
    return np.asarray(brightness / np.median(brightness[solution.inliers]), dtype=np.float64)


def bright_points(scan: Scan, solution: Solution, settings: RobustSettings) -> BoolArray:
    """Points (N,) that are as bright as bone; all of them where amplitudes tell nothing of it."""
    s, all_of_them = settings.brightness, np.ones(len(scan), dtype=np.bool_)
    if scan.response_mv is None or solution.inliers.mean() < settings.trust.min_inlier_share:
        return all_of_them  # the registration fails anyway, and its inliers are no measure of bone
    if np.median(scan.response_mv[solution.inliers]) <= 0.0:
        return all_of_them  # no amplitudes at all
    bright: BoolArray = relative_brightness(scan, scan.response_mv, solution, s) > s.min_share
    return bright if bright[solution.inliers].mean() >= s.min_bright_inliers else all_of_them


def fitted_again(
    scan: Scan, model: Model, solution: Solution, regions: FloatArray, settings: RobustSettings, *, noise_known: bool
) -> Solution:
    """The solution after another beam fit from it, of points that were moved a little since."""
    allowed = bright_points(scan, solution, settings)
    allowed &= outside_regions(transform(solution.model_from_scanner, scan.points), regions)
    fitter = BeamFitter(scan, model.surface, solution.noise, solution.around, noise_known, settings, solution.edges)
    fit = fitter.fit(solution.model_from_scanner, allowed)
    moved = fit.model_from_scanner @ inverse(solution.model_from_scanner)
    return replace(
        solution,
        model_from_scanner=fit.model_from_scanner,
        closest=fit.closest(scan, model.surface),
        inliers=fit.inliers,
        history=[*solution.history, *fit.history],
        noise=fit.noise,
        alternatives=[replace(end, model_from_scanner=moved @ end.model_from_scanner) for end in solution.alternatives],
        observed=fit.observed,
    )


def without_dark_points(
    scan: Scan, model: Model, solution: Solution, regions: FloatArray, settings: RobustSettings
) -> Solution:
    """Solve again, from the pose found, with the points alone that are as bright as bone.

    Parameters
    ----------
    scan : Scan
        With `response_mv`; otherwise the solution stays as it is.
    model : Model
    solution : Solution
        Of the robust method.
    regions : (K, 4) array
        Excluded spheres of the model, centre and radius.
    settings : RobustSettings
    """
    s = settings.brightness
    bright = bright_points(scan, solution, settings)
    if bright.all():
        return solution
    near = register_near(scan.thinned(s.search_points, bright), model, solution.model_from_scanner, regions, settings)
    pose = near.model_from_scanner
    allowed = bright & outside_regions(transform(pose, scan.points), regions)
    bright_neighbours = np.where(np.append(bright, False)[solution.around], solution.around, len(scan))
    fitter = BeamFitter(scan, model.surface, near.noise, bright_neighbours, scan.noise_known, settings, near.edges)
    fit = fitter.fit(pose, allowed)
    return replace(
        solution,
        model_from_scanner=fit.model_from_scanner,
        closest=fit.closest(scan, model.surface),
        inliers=fit.inliers,
        history=[*solution.history, *near.history, *fit.history],
        noise=fit.noise,
        alternatives=near.alternatives,
        observed=fit.observed,
    )
