"""Beside a pose that is held weakly: other minima within the reach of the likelihood, which a fit from there finds.

About a nearly spherical socket the likelihood is a shallow valley, notched wherever a beam passes the edge of a fossa
or of the rim, or a clump of tissue is taken for bone. Steps from one side come to rest in one notch. So where the
points hold the rotation weakly, the beam fit is begun again from places round about; the likeliest end is taken, and
how far others lie apart belongs to the uncertainty. Wrong poses 2 to 4 deg off, with a standard deviation of 0.3 to
0.5 deg, are not suspected by fits from two standard deviations along the weakest motion; fits from turns of 2 and 4 deg
about all axes meet the other minimum.

Equation numbers are those of ``docs/registration.md``.

References
----------
Brossard, Bonnabel, Barrau, ICRA (2020): a covariance without the dispersion over starts is over-confident.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.least_squares import information, plane_rows, weighted_squares
from picoradar.registration.refine.beam_fit import BeamFit
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import inverse, small_motion, transform, vector_from_rotation
from picoradar.registration.settings import WeakModeSettings
from picoradar.registration.solution import Alternative

MIN_SHARE = 0.1
"""Least share of the information of points known to be bone that is left in any direction: sums of few doubtful points
may fall below nothing."""


def beside_weak(
    best: BeamFit, scan: Scan, fitted: Callable[[FloatArray], BeamFit], settings: WeakModeSettings
) -> list[BeamFit]:
    """Beam fits begun beside a fit, itself the first; alone where the rotation is held well [eq. 12].

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
    covariance, centre = fit_covariance(best, scan)
    turns = covariance[:3, :3]
    spread_deg = float(np.degrees(np.sqrt(max(np.trace(turns), 0.0))))
    if spread_deg <= settings.min_rotation_sd_deg:
        return [best]
    axes = np.linalg.eigh(turns)[1][:, ::-1][:, : settings.walked_axes]
    together = covariance[:, :3] @ np.linalg.pinv(turns, hermitian=True)  # the shift that goes with a turn
    motions = [
        sign * np.radians(deg) * together @ axis for deg in settings.walk_deg for axis in axes.T for sign in (-1, 1)
    ]
    return [best, *(fitted(small_motion(x, centre) @ best.model_from_scanner) for x in motions)]


def alternatives_of(
    best: BeamFit, fits: Sequence[BeamFit], scan: Scan, points: int, settings: WeakModeSettings
) -> list[Alternative]:
    """Other minima that were fitted, each once, weighted by their mean log likelihoods over so many points [eq. 12].

    What lies within `same_sds` standard deviations of the fit, or of a likelier end, is the same minimum.

    Parameters
    ----------
    best : BeamFit
    fits : sequence of BeamFit
    scan : Scan
    points : int
    settings : WeakModeSettings
    """
    if int(best.inliers.sum()) < settings.min_points:
        return []
    covariance, centre = fit_covariance(best, scan)
    scale = np.linalg.pinv(covariance, hermitian=True)
    known, found = [np.zeros(6)], list[Alternative]()
    for fit in sorted((fit for fit in fits if fit is not best), key=lambda fit: -fit.log_likelihood):
        fall = min(0.0, fit.log_likelihood - best.log_likelihood) * points
        weight = float(np.exp(fall / settings.e_fold_nats))
        if weight < settings.min_weight:
            break
        motion = motion_between(best.model_from_scanner, fit.model_from_scanner, centre)
        apart = [motion - other for other in known]
        if min(float(x @ scale @ x) for x in apart) > settings.same_sds**2:
            known.append(motion)
            found.append(Alternative(fit.model_from_scanner, weight))
    return found


def motion_between(one: FloatArray, other: FloatArray, centre: FloatArray) -> FloatArray:
    """Motion (6,) about `centre` (3,) from one pose (4, 4) to another."""
    moved = other @ inverse(one)
    return np.concatenate([vector_from_rotation(moved[:3, :3]), transform(moved, centre[None])[0] - centre])


def dispersion(best: FloatArray, alternatives: list[Alternative], centre: FloatArray) -> FloatArray:
    """Covariance (6, 6) of alternatives to a pose (4, 4) [eq. 12]: weighted squares of the motions about `centre`."""
    total, weights = np.zeros((6, 6)), 1.0
    for end in alternatives:
        motion = motion_between(best, end.model_from_scanner, centre)
        total += end.weight * np.outer(motion, motion)
        weights += end.weight
    return total / weights


def observed_information(rows: FloatArray, observed: FloatArray, known: FloatArray) -> FloatArray:
    """Information (K, K) of rows (N, K) with the weights observed (N,), no less than `MIN_SHARE` of `known` (K, K).

    `known` is the information of the inliers, were they bone beyond doubt.
    """
    if not np.linalg.eigvalsh(known)[0] > 0.0:
        return known
    root = np.linalg.cholesky(known)
    half = np.linalg.solve(root, weighted_squares(rows, observed))
    shares, axes = np.linalg.eigh(np.linalg.solve(root, half.T))
    back = root @ axes
    return np.asarray(back * np.maximum(shares, MIN_SHARE) @ back.T, dtype=np.float64)


def fit_covariance(fit: BeamFit, scan: Scan) -> tuple[FloatArray, FloatArray]:
    """Covariance (6, 6) of a fit by the information observed [eq. 10], about the inliers' centre (3,)."""
    rows, sigma, centre = inlier_rows(fit, scan)
    found = information(rows, sigma)
    if fit.observed is not None:
        counts = np.flatnonzero(fit.observed)
        places = transform(fit.model_from_scanner, scan.points[counts])
        every = plane_rows(places, fit.met.normals[counts], centre)
        found = observed_information(every, fit.observed[counts], found)
    return np.asarray(np.linalg.pinv(found, hermitian=True), dtype=np.float64), centre


def inlier_rows(fit: BeamFit, scan: Scan) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Plane rows (M, 6) and sigmas (M,) of a fit's inliers, about their centre (3,)."""
    on = fit.inliers
    pose, normals = fit.model_from_scanner, fit.met.normals[on]
    points = transform(pose, scan.points[on])
    centre = np.asarray(points.mean(axis=0), dtype=np.float64)
    sigma = fit.noise.plane_sigma(scan, pose[:3, :3], fit.met.normals)[on]
    return plane_rows(points, normals, centre), sigma, centre
