"""Closest points under a loss that narrows: a pose a few millimetres beside a sharp minimum is drawn into it.

Where few points hold a motion (strips beside an edge, a key), the likelihood of a pose falls to that of stray points
within a few sigma, and neither cast beams nor rounded fields tell which way to go: a beam that should meet a side
meets the top, or nothing. The closest point does tell. So the loss starts wide, where all points pull, and narrows step
by step until those that do not belong to the surface have no weight.

References
----------
Black, Rangarajan, Int. J. Comput. Vis. 19:57 (1996): graduated non-convexity.
"""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.least_squares import damped_step, plane_rows, weighted_squares
from picoradar.registration.model import Closest, Surface
from picoradar.registration.refine.beam_fit import ridge
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import orthonormalised, small_motion, transform
from picoradar.registration.settings import RobustSettings


def annealed(
    scan: Scan, surface: Surface, start: FloatArray, allowed: BoolArray, settings: RobustSettings
) -> FloatArray:
    """Step from `start` (4, 4) to where the closest points of all that fits lie [eq. 13].

    Parameters
    ----------
    scan : Scan
    surface : Surface
    start : (4, 4) array
    allowed : (N,) array of bool
        Points that may take part.
    settings : RobustSettings
    """
    s, stiffness, pose = settings.edges, ridge(settings.beam_fit), start
    for scale in s.loss_scales_mm:
        for _ in range(s.steps_a_scale):
            moved = transform(pose, scan.points)
            near = surface.closest(moved)
            facing = faces_beams(surface, near, scan.beams @ pose[:3, :3].T, s.min_cosine)
            known = allowed & facing & ~surface.beyond_border(near)
            weight = np.exp(-((near.signed_mm / scale) ** 2)) * known
            centre = np.asarray(moved.mean(axis=0), dtype=np.float64)
            rows = plane_rows(moved, near.normals, centre)
            x = damped_step(weighted_squares(rows, weight), rows.T @ (weight * near.signed_mm), stiffness)
            pose = small_motion(x, centre) @ pose
            if np.abs(rows @ x).max() < s.settled_share * scale:
                break
    return orthonormalised(pose)


def faces_beams(surface: Surface, near: Closest, beams: FloatArray, min_cosine: float) -> BoolArray:
    """Which closest points (N,) a beam can come from.

    The direction from a silhouette to a point beside it may face away where the face that the point overhangs does not:
    of an edge both faces count. (The edge's own normal halves their angle, so that it mirrors one onto the other.)
    """
    facing: BoolArray = -np.einsum("ij,ij->i", near.normals, beams) > min_cosine
    doubtful = np.flatnonzero(~facing)
    if len(doubtful) > 0:
        feet = surface.closest(near.points[doubtful])
        one, edge = surface.face_normals[feet.faces], feet.normals
        other = 2.0 * np.einsum("ij,ij->i", one, edge)[:, None] * edge - one
        facing[doubtful] = -np.einsum("kij,ij->ki", np.stack([one, other]), beams[doubtful]).min(axis=0) > min_cosine
    return facing
