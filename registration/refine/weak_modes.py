"""Along the motion that the points hold worst: minima that lie beside each other in one long valley.

About a nearly spherical socket the likelihood is a shallow valley, notched wherever a beam passes the edge of a fossa
or of the rim. Steps from one side come to rest in one notch. So where the points hold the rotation weakly, the finish
is begun again from both sides; the likeliest end is taken, and how far others lie apart belongs to the uncertainty.

References
----------
Brossard, Bonnabel, Barrau, ICRA (2020): a covariance without the dispersion over starts is over-confident.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.least_squares import information, plane_rows
from picoradar.registration.refine.beam_fit import Final
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import inverse, small_motion, transform, vector_from_rotation
from picoradar.registration.solution import End

WEAK_DEG = 0.25
"""Standard deviation of the rotation from which on the valley is walked."""

STEPS_SD = (-2.0, 2.0)
"""Where the finish begins again, in standard deviations along the weakest motion."""

FARTHEST_RAD = 0.1
"""Most that one standard deviation may turn: a motion that nothing holds has no valley to walk."""

LEAST_POINTS = 20
"""With fewer points there is no telling which motion is weak."""

NATS = 5.0
"""An end whose log likelihood is so much lower counts for 1 / e: neighbours are not independent."""


def walked(final: Final, scan: Scan, finished: Callable[[FloatArray], Final]) -> list[Final]:
    """Ends of a walk along the valley about a final pose, itself the first; alone where it is held well.

    Parameters
    ----------
    final : Final
    scan : Scan
    finished : callable
        Finishes from a pose (4, 4).
    """
    if int(final.inliers.sum()) < LEAST_POINTS:
        return [final]
    motion, centre, spread_deg = _weakest_motion(final, scan)
    if spread_deg <= WEAK_DEG:
        return [final]
    pose = final.model_from_scanner
    return [final, *(finished(small_motion(step * motion, centre) @ pose) for step in STEPS_SD)]


def ends_beside(best: Final, ends: list[Final], points: int) -> list[End]:
    """The ends of a walk but for the best, weighted by their log likelihoods, which are means of so many points."""
    return [
        End(end.model_from_scanner, float(np.exp((end.log_likelihood - best.log_likelihood) * points / NATS)))
        for end in ends
        if end is not best
    ]


def dispersion(best: FloatArray, ends: list[End], centre: FloatArray) -> FloatArray:
    """Covariance (6, 6) of the ends about a pose (4, 4): weighted squares of the motions about `centre` (3,)."""
    total, weights = np.zeros((6, 6)), 1.0
    for end in ends:
        moved = end.model_from_scanner @ inverse(best)
        motion = np.concatenate([vector_from_rotation(moved[:3, :3]), transform(moved, centre[None])[0] - centre])
        total += end.weight * np.outer(motion, motion)
        weights += end.weight
    return total / weights


def _weakest_motion(final: Final, scan: Scan) -> tuple[FloatArray, FloatArray, float]:
    """Motion (6,) of one standard deviation about a centre (3,), and the rotation's standard deviation in deg."""
    on = final.inliers
    pose, normals = final.model_from_scanner, final.met.normals[on]
    places = transform(pose, scan.points[on])
    centre = np.asarray(places.mean(axis=0), dtype=np.float64)
    sigma = final.noise.plane_sigma(scan, pose[:3, :3], final.met.normals)[on]
    covariance = np.linalg.pinv(information(plane_rows(places, normals, centre), sigma), hermitian=True)
    variances, axes = np.linalg.eigh(covariance[:3, :3])
    spread = float(np.sqrt(max(variances[-1], np.finfo(np.float64).tiny)))
    motion = covariance[:, :3] @ axes[:, -1] / spread * min(1.0, FARTHEST_RAD / spread)
    return motion, centre, float(np.degrees(np.sqrt(max(variances.sum(), 0.0))))
