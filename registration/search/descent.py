"""From starts on a view to candidates: successive halving, and the refinement of those that survive it."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.model import View
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import pose
from picoradar.registration.search.field_factor import Beams, Poses
from picoradar.registration.search.minima import Candidate, merged
from picoradar.registration.search.refine import refined
from picoradar.registration.search.successive_halving import Cloud, distinct, successive_halving
from picoradar.registration.settings import RobustSettings, Stage


class Descent:
    """Lets poses of a scan descend on views of a model.

    Parameters
    ----------
    scan : Scan
    sigma_mm : float
        Noise along the beam.
    settings : RobustSettings
    """

    def __init__(self, scan: Scan, sigma_mm: float, settings: RobustSettings) -> None:
        self.scan, self.sigma_mm, self.settings = scan, sigma_mm, settings
        self.middle = np.asarray(scan.points.mean(axis=0), dtype=np.float64)
        self.stretch = max(1.0, sigma_mm / settings.noise.typical_range_mm)
        self.thin = scan.thinned(settings.search.refined_points)

    def from_starts(
        self,
        view: View,
        centre: FloatArray,
        order: IntArray,
        rotations: FloatArray,
        shifts: FloatArray,
        stages: tuple[Stage, ...],
    ) -> list[Candidate]:
        """Distinct candidates that survive successive halving, refined, best first.

        Parameters
        ----------
        view : View
        centre : (3,) array
            Scanner frame, mm; the rotations are about it.
        order : (N,) array of int
            In which the stages take the points.
        rotations : (K, 3, 3) array
        shifts : (K, 3) array
            From the view's centre to where `centre` comes to lie, mm.
        stages : tuple of Stage
        """
        cloud = Cloud.about(self.scan.points, self.scan.beams, centre, order)
        starts = Poses(rotations.astype(np.float32), shifts.astype(np.float32))
        survived = successive_halving(view, cloud, starts, stages, self.stretch, self.settings)
        first, hits = distinct(survived, self.settings.search)
        return self._refined(view, centre, survived.at(first), hits, self.settings.search.max_refined)

    def rated(self, view: View, given: FloatArray) -> Candidate:
        """A pose (4, 4) as it is, as a candidate that no survivor ended at."""
        rotations = given[None, :3, :3]
        shifts = rotations @ self.middle + given[None, :3, 3] - view.centre
        poses = Poses(rotations.astype(np.float32), shifts.astype(np.float32))
        beams = Beams.of(self.thin.points - self.middle, self.thin.beams)
        _, likelihood = refined(view.fine, poses, beams, self.thin.around, self.sigma_mm, (0, 0), self.settings)
        return Candidate(given, float(likelihood[0]), 0, view)

    def _refined(self, view: View, centre: FloatArray, given: Poses, hits: IntArray, count: int) -> list[Candidate]:
        """Refine all a little and the best `count` of them to the end."""
        search = self.settings.search
        beams = Beams.of(self.thin.points - centre, self.thin.beams)
        around, sigma = self.thin.around, self.sigma_mm
        coarse, fine = (search.coarse_steps, 0), (search.fine_steps, search.cast_steps)
        poses, likelihood = refined(view.fine, given, beams, around, sigma, coarse, self.settings)
        best = np.argsort(-likelihood, kind="stable")[:count]
        poses, likelihood = refined(view.fine, poses.at(best), beams, around, sigma, fine, self.settings)
        rotation = poses.rotations.astype(np.float64)
        model_from_scanner = pose(rotation, view.centre + poses.shifts - rotation @ centre)
        ends = zip(model_from_scanner, likelihood, hits[best], strict=True)
        candidates = [Candidate(p, float(v), int(h), view) for p, v, h in ends]
        return merged([], candidates, self.middle, search)
