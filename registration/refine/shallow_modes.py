"""Motions that the information calls stiff and the beams do not: the information of edges, put to the test.

A motion that is stiff to one side, where a face would turn into sight, may be free to the other, and the edge of a face
may hold at the minimum what nothing holds beside it. A few points make that information, so the motions tried are those
that the others hold worst, up to the tolerance of the clinic.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.least_squares import information
from picoradar.registration.refine.beam_fit import BeamFit
from picoradar.registration.refine.weak_modes import inlier_rows
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import small_motion, transform
from picoradar.registration.settings import EdgeSettings, RobustSettings
from picoradar.registration.solution import Alternative


def shallow_poses(
    fit: BeamFit, scan: Scan, likelihood: Callable[[FloatArray], float], settings: RobustSettings
) -> list[tuple[FloatArray, float]]:
    """Poses (4, 4) beside a fit that are hardly less likely, whatever the information says [eq. 14].

    Poses count whose log likelihood falls by less than a share of what the information of all points predicts.

    Parameters
    ----------
    fit : BeamFit
    scan : Scan
    likelihood : callable
        Mean log likelihood a point of a pose (4, 4).
    settings : RobustSettings

    Returns
    -------
    list of (pose, fall)
        By how much the mean log likelihood falls; negative where it rises.
    """
    s = settings.edges
    if int(fit.inliers.sum()) < settings.weak_mode.min_points:
        return []
    rows, sigma, centre = inlier_rows(fit, scan)
    whole = information(rows, sigma)
    leverage = np.einsum("ni,ij,nj->n", rows, np.linalg.pinv(whole, hermitian=True), rows) / sigma**2
    many = leverage < s.max_leverage * leverage.mean()
    here = likelihood(fit.model_from_scanner)
    found = []
    for motion in _worst_held(information(rows[many], sigma[many]), fit, scan, centre, s):
        for share in s.probe_shares:
            step = share * motion
            pose = small_motion(step, centre) @ fit.model_from_scanner
            fall = here - likelihood(pose)
            if fall * len(scan) < s.min_fall_share * float(step @ whole @ step) / 2.0:
                found.append((pose, fall))
    return found


def alternatives_at(falls: list[tuple[FloatArray, float]], points: int, e_fold_nats: float) -> list[Alternative]:
    """Poses with what their mean log likelihoods lack, weighted as the ends of a walk along a weak mode [eq. 12]."""
    return [Alternative(pose, float(np.exp(min(0.0, -fall) * points / e_fold_nats))) for pose, fall in falls]


def _worst_held(held: FloatArray, fit: BeamFit, scan: Scan, centre: FloatArray, settings: EdgeSettings) -> FloatArray:
    """The motions (K, 6) that an information (6, 6) about `centre` (3,) holds worst, each as far as is tried."""
    local = transform(fit.model_from_scanner, scan.points[fit.inliers]) - centre
    radius = float(np.sqrt((local**2).sum(axis=1).mean()))
    scale = np.array([1.0 / radius] * 3 + [1.0] * 3)
    motions = (np.linalg.eigh(held * np.outer(scale, scale))[1] * scale[:, None]).T[: settings.probed_motions]
    turns = np.linalg.norm(motions[:, :3], axis=1) / settings.probe_rad
    moved = np.cross(motions[:, None, :3], local) + motions[:, None, 3:]
    shifts = np.sqrt((moved**2).sum(axis=2).mean(axis=1)) / settings.probe_mm
    return np.asarray(motions / np.maximum(turns, shifts)[:, None])
