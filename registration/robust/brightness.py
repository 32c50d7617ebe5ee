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
from picoradar.registration.refine import exact_finish, outside_regions
from picoradar.registration.robust.schedule import register_beside
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import transform
from picoradar.registration.solution import Solution

DARK = 0.75
"""Share of the brightness of bone below which a point is none (soft tissue has about 0.75, blood 0.35)."""

GRAZING_SHARE = 0.3
"""Rough bone seen at grazing incidence keeps this share of its brightness (Oren and Nayar 1994)."""

ENOUGH = 0.5
"""Were fewer of the inliers bright than this, the amplitudes would be no measure of the material: all stay."""


LOOKED = 3000
"""Points that the look beside the pose is taken with; all take part in the last finish."""

LEAST_SHARE = 0.25
"""With fewer points on the model the registration fails anyway, and its inliers are no measure of bone."""


def relative_brightness(scan: Scan, response_mv: FloatArray, solution: Solution) -> FloatArray:
    """Amplitudes (N,) over what bone would send back at that range and incidence; the median inlier has 1."""
    beams = scan.beams @ solution.model_from_scanner[:3, :3].T
    cosine = np.clip(-np.einsum("ij,ij->i", solution.closest.normals, beams), 0.0, 1.0)
    ranges = np.linalg.norm(scan.points - scan.origin, axis=1)
    brightness = response_mv * ranges**2 / (GRAZING_SHARE + (1.0 - GRAZING_SHARE) * cosine)
    return np.asarray(brightness / np.median(brightness[solution.inliers]), dtype=np.float64)


def without_dark_points(scan: Scan, model: Model, solution: Solution, regions: FloatArray) -> Solution:
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
    """
    if scan.response_mv is None or solution.inliers.mean() < LEAST_SHARE:
        return solution
    if np.median(scan.response_mv[solution.inliers]) <= 0.0:
        return solution  # no amplitudes at all
    bright: BoolArray = relative_brightness(scan, scan.response_mv, solution) > DARK
    if bright.all() or bright[solution.inliers].mean() < ENOUGH:
        return solution
    again = register_beside(scan.thinned(LOOKED, bright), model, solution.model_from_scanner, regions)
    pose = again.model_from_scanner
    allowed = bright & outside_regions(transform(pose, scan.points), regions)
    voters = np.where(np.append(bright, False)[solution.around], solution.around, len(scan))
    final = exact_finish(scan, model.surface, pose, again.noise, voters, allowed, noise_known=scan.noise_known)
    return replace(
        solution,
        model_from_scanner=final.model_from_scanner,
        closest=final.closest(scan, model.surface),
        inliers=final.inliers,
        history=[*solution.history, *again.history, *final.history],
        noise=final.noise,
        beside=again.beside,
    )
