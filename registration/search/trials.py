"""From starts on a view to candidates: a race, and the polish of those who finish."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.model import View
from picoradar.registration.scan import TYPICAL_RANGE_MM, Scan
from picoradar.registration.se3 import pose
from picoradar.registration.search.batch import Poses
from picoradar.registration.search.minima import Candidate, merged
from picoradar.registration.search.refine import polish
from picoradar.registration.search.successive_halving import Cloud, Heat, distinct, race

POLISHED_POINTS = 1500
"""Candidates are polished and compared on at most so many points; all take part in the last finish."""

FINALISTS = 4
"""Candidates of a race that are polished to the end."""


class Trials:
    """Tries poses of a scan on views of a model.

    Parameters
    ----------
    scan : Scan
    sigma_mm : float
        Noise along the beam.
    """

    def __init__(self, scan: Scan, sigma_mm: float) -> None:
        self.scan, self.sigma_mm = scan, sigma_mm
        self.middle = np.asarray(scan.points.mean(axis=0), dtype=np.float64)
        self.stretch = max(1.0, sigma_mm / TYPICAL_RANGE_MM)
        self.thin = scan.thinned(POLISHED_POINTS)

    def raced(
        self,
        view: View,
        centre: FloatArray,
        order: IntArray,
        rotations: FloatArray,
        shifts: FloatArray,
        heats: tuple[Heat, ...],
    ) -> list[Candidate]:
        """Distinct candidates of a race, best first.

        Parameters
        ----------
        view : View
        centre : (3,) array
            Scanner frame, mm; the rotations are about it.
        order : (N,) array of int
            In which the heats take the points.
        rotations : (K, 3, 3) array
        shifts : (K, 3) array
            From the view's centre to where `centre` comes to lie, mm.
        heats : tuple of Heat
        """
        cloud = Cloud.about(self.scan.points, self.scan.beams, centre, order)
        starts = Poses(rotations.astype(np.float32), shifts.astype(np.float32))
        finishers = race(view, cloud, starts, self.stretch, heats)
        first, hits = distinct(finishers)
        return self._polished(view, centre, finishers.at(first), hits, FINALISTS)

    def polished(self, view: View, poses: FloatArray) -> list[Candidate]:
        """Distinct candidates about the `poses` (K, 4, 4), best first, each counted once."""
        rotations = poses[:, :3, :3]
        shifts = rotations @ self.middle + poses[:, :3, 3] - view.centre
        given = Poses(rotations.astype(np.float32), shifts.astype(np.float32))
        return self._polished(view, self.middle, given, np.ones(len(poses), dtype=np.int64), len(poses))

    def _polished(
        self, view: View, centre: FloatArray, given: Poses, hits: IntArray, finalists: int
    ) -> list[Candidate]:
        points = np.ascontiguousarray((self.thin.points - centre).T, dtype=np.float32)
        beams = np.ascontiguousarray(self.thin.beams.T, dtype=np.float32)
        around, sigma = self.thin.around, self.sigma_mm
        polished, likelihood = polish(view.fine, given, points, beams, around, sigma)
        best = np.argsort(-likelihood, kind="stable")[:finalists]
        polished, likelihood = polish(view.fine, polished.at(best), points, beams, around, sigma, (2, 3))
        rotation = polished.rotations.astype(np.float64)
        poses = pose(rotation, view.centre + polished.shifts - rotation @ centre)
        ends = zip(poses, likelihood, hits[best], strict=True)
        return merged([], [Candidate(p, float(v), int(h), view) for p, v, h in ends], self.middle, bonus=0)
