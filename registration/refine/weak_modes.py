"""Along the motion that the points hold worst: minima that lie side by side in one long valley of the likelihood.

About a nearly spherical socket the likelihood is a shallow valley, notched wherever a beam passes the edge of a fossa
or of the rim. Steps from one side come to rest in one notch. So where the points hold the rotation weakly, the beam fit
is begun again from both sides; the likeliest end is taken, and how far others lie apart belongs to the uncertainty.

Equation numbers are those of ``docs/registration.md``.

References
----------
Brossard, Bonnabel, Barrau, ICRA (2020): a covariance without the dispersion over starts is over-confident.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.least_squares import information, plane_rows
from picoradar.registration.refine.beam_fit import BeamFit
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import inverse, small_motion, transform, vector_from_rotation
from picoradar.registration.settings import WeakModeSettings
from picoradar.registration.solution import Alternative


def along_weak_mode(
    best: BeamFit, scan: Scan, fitted: Callable[[FloatArray], BeamFit], settings: WeakModeSettings
) -> list[BeamFit]:
    """Beam fits begun along the weakest motion about a fit [eq. 12], itself the first; alone where it is held well.

    Parameters
    ----------
    best : BeamFit
    scan : Scan
    fitted : callable
        Fits from a pose (4, 4).
    settings : WeakModeSettings
    """
    if int(best.inliers.sum()) < settings.min_points:
        return [best]
    motion, centre, spread_deg = _weakest_motion(best, scan, settings.max_sd_rad)
    if spread_deg <= settings.min_rotation_sd_deg:
        return [best]
    pose = best.model_from_scanner
    to_either_side = (-settings.walk_sd, settings.walk_sd)
    return [best, *(fitted(small_motion(sd * motion, centre) @ pose) for sd in to_either_side)]


def alternatives_of(best: BeamFit, fits: list[BeamFit], points: int, settings: WeakModeSettings) -> list[Alternative]:
    """The fits but for the best, weighted by their log likelihoods, which are means of so many points [eq. 12]."""
    return [
        Alternative(
            fit.model_from_scanner,
            float(np.exp((fit.log_likelihood - best.log_likelihood) * points / settings.e_fold_nats)),
        )
        for fit in fits
        if fit is not best
    ]


def dispersion(best: FloatArray, alternatives: list[Alternative], centre: FloatArray) -> FloatArray:
    """Covariance (6, 6) of alternatives to a pose (4, 4) [eq. 12]: weighted squares of the motions about `centre`."""
    total, weights = np.zeros((6, 6)), 1.0
    for end in alternatives:
        moved = end.model_from_scanner @ inverse(best)
        motion = np.concatenate([vector_from_rotation(moved[:3, :3]), transform(moved, centre[None])[0] - centre])
        total += end.weight * np.outer(motion, motion)
        weights += end.weight
    return total / weights


def _weakest_motion(fit: BeamFit, scan: Scan, max_sd_rad: float) -> tuple[FloatArray, FloatArray, float]:
    """Motion (6,) of one standard deviation about a centre (3,), and the rotation's standard deviation in deg."""
    rows, sigma, centre = inlier_rows(fit, scan)
    covariance = np.linalg.pinv(information(rows, sigma), hermitian=True)
    variances, axes = np.linalg.eigh(covariance[:3, :3])
    spread = float(np.sqrt(max(variances[-1], np.finfo(np.float64).tiny)))
    motion = covariance[:, :3] @ axes[:, -1] / spread * min(1.0, max_sd_rad / spread)
    return motion, centre, float(np.degrees(np.sqrt(max(variances.sum(), 0.0))))


def inlier_rows(fit: BeamFit, scan: Scan) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Plane rows (M, 6) and sigmas (M,) of a fit's inliers, about their centre (3,)."""
    on = fit.inliers
    pose, normals = fit.model_from_scanner, fit.met.normals[on]
    points = transform(pose, scan.points[on])
    centre = np.asarray(points.mean(axis=0), dtype=np.float64)
    sigma = fit.noise.plane_sigma(scan, pose[:3, :3], fit.met.normals)[on]
    return plane_rows(points, normals, centre), sigma, centre
