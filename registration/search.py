"""Finds the distinct minima of a registration: from anywhere, or about a start."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from registration._types import FloatArray, IntArray
from registration.batch import Poses
from registration.centres import sphere_centres, sphere_support
from registration.cone import ANYWHERE, Cone, rotations_within
from registration.errors import StartError
from registration.minima import SURE_HITS, Candidate, merged
from registration.model import Model
from registration.noise import TYPICAL_RANGE_MM
from registration.polish import polish
from registration.race import HEATS, NEAR_HEATS, PATIENT_HEATS, Cloud, Heat, distinct, race, shuffle, telling_order
from registration.rigid import inverse, pose, transform
from registration.scan import Scan
from registration.seeds import rotations_near
from registration.views import SHELL_CONE_DEG, Place, View
from registration.visibility import visible_centroids

STARTS = 256
"""Rotations that enter one race."""

MAX_RACES = 4
"""Races run at most while the best minimum is not sure."""

PATIENT_DRAW = 2
"""Races from this one on leave more starts in: two have not made the best minimum sure."""

WHOLE_RACES = 3
"""Races run at least on a whole model: manufactured bodies are symmetric, and their rivals should be seen."""

START_CONE_DEG = 25.0
"""How far clicked landmarks may be off."""

START_REACH_MM = 40.0
"""How far a start may be off in position."""

POLISHED_POINTS = 1500
"""Candidates are polished and compared on at most so many points; all take part in the last finish."""

COVERED = 0.6
"""A prepared view serves a start when it holds so many of the points, for a start may be off."""

FINE_STEP_MM = 1.5
"""The prepared view of a whole model serves starts when its field is as fine as this."""

CLEAR = 40.0
"""A minimum is clear when its log likelihood exceeds the next one's by so much."""

MET_BY_MANY = 4
"""A clear minimum that so many finishers reached needs no closer look."""

CLEAR_LOOK, UNCLEAR_LOOK = (8.0, 32), (30.0, 128)
"""Half angle (deg) and starts of the closer look about the best minimum."""

OTHER_RADII = (0.96, 1.04)
"""Further radii of the socket's sphere, as shares of the model's, that are tried where the first race is not clear."""

LEEWAY_DEG = 2.0
"""A pose found may lie so far outside the cone that was given."""

FINALISTS = 4
"""Candidates of a race that are polished to the end."""


class Search:
    """Searches a model for the poses that explain a scan.

    Parameters
    ----------
    scan : Scan
    model : Model
    sigma_mm : float
        Noise along the beam.
    cone : Cone, optional
        Directions that the scanner may look from.
    """

    def __init__(self, scan: Scan, model: Model, sigma_mm: float, cone: Cone = ANYWHERE) -> None:
        self.scan, self.model, self.sigma_mm, self.cone = scan, model, sigma_mm, cone
        self.towards = _unit(-scan.beams.mean(axis=0))
        self.middle = np.asarray(scan.points.mean(axis=0), dtype=np.float64)
        self.stretch = max(1.0, sigma_mm / TYPICAL_RANGE_MM)
        self.thin = scan.thinned(POLISHED_POINTS)

    @cached_property
    def centres(self) -> list[list[FloatArray]]:
        """Centres of each view's sphere in the scanner frame; of the whole model, the cloud's middle."""
        return [
            [self.middle] if view.whole else sphere_centres(self.scan.points, self.towards, view.radius_mm)
            for view in self.model.views
        ]

    @cached_property
    def more_centres(self) -> list[list[FloatArray]]:
        """The same for spheres a little smaller and larger, too: sockets are no true spheres."""
        return [
            centres
            if view.whole
            else centres
            + [
                centre
                for factor in OTHER_RADII
                for centre in sphere_centres(self.scan.points, self.towards, factor * view.radius_mm, 2)
            ]
            for view, centres in zip(self.model.views, self.centres, strict=True)
        ]

    def from_anywhere(self) -> list[Candidate]:
        """Distinct minima, best first; races are run until the best one is sure.

        Raises
        ------
        StartError
            If the sphere of the model's socket fits nowhere, or no pose of the cone explains the points.
        """
        if not any(self.centres):
            raise StartError("no sphere of the model's socket fits the points: give landmarks or a pose to start from")
        found: list[Candidate] = []
        least = WHOLE_RACES if any(view.whole for view in self.model.views) else 1
        for draw in range(MAX_RACES):
            anchors = self.centres if draw == 0 else self.more_centres
            for index in self._likely_first():
                if anchors[index]:
                    found = merged(found, self._raced(self.model.views[index], anchors[index], draw), self.middle)
                if draw == 0 and found and self._margin(found) > CLEAR:
                    break
            if not found:
                raise StartError("no hollow of the model opens to the cone of directions: widen it, or give a pose")
            if self._margin(found) <= CLEAR or found[0].hits < MET_BY_MANY:
                found = merged(found, self._near(found, draw), self.middle, bonus=0)
            enough = self._margin(found) > CLEAR or (draw > 0 and self.sure(found))
            if enough and draw + 1 >= least:
                break
        plausible = [c for c in found if self.cone.holds(c.model_from_scanner[:3, :3] @ self.towards, LEEWAY_DEG)]
        if not plausible:
            raise StartError("no pose within the cone of directions explains the points: widen it, or search anywhere")
        return plausible

    def _likely_first(self) -> list[int]:
        """Views by how much of the cloud lies on their spheres: a wrong hollow need not be raced."""
        support = [
            sphere_support(self.scan.points, centres[0], view.radius_mm) if centres and view.is_socket else 0.0
            for view, centres in zip(self.model.views, self.centres, strict=True)
        ]
        return [int(k) for k in np.argsort(-np.array(support), kind="stable")]

    def sure(self, found: list[Candidate]) -> bool:
        """Whether the best minimum was met often enough, or stands out so clearly, that no better one was missed."""
        return found[0].hits >= SURE_HITS or self._margin(found) > CLEAR

    def _margin(self, found: list[Candidate]) -> float:
        """How much better the best minimum explains all points than the next."""
        if len(found) < 2:
            return float("inf")
        return (found[0].log_likelihood - found[1].log_likelihood) * len(self.thin)

    def _near(self, found: list[Candidate], draw: int) -> list[Candidate]:
        """Minima about the best one: a narrow look where it is clear, a wide one where others are nearly as good."""
        look = CLEAR_LOOK if self._margin(found) > CLEAR else UNCLEAR_LOOK
        return [replace(c, hits=0) for c in self._looked(found[0].model_from_scanner, found[0].view, look, draw)]

    def beside(self, solved: FloatArray) -> list[Candidate]:
        """Distinct minima beside a pose (4, 4) that other points led to, best first."""
        return self._looked(solved, self._view_at(solved), CLEAR_LOOK, 0)

    def _looked(self, about: FloatArray, view: View, look: tuple[float, int], draw: int) -> list[Candidate]:
        half_angle_deg, starts = look
        rotations = rotations_near(about[:3, :3], half_angle_deg, starts, draw * starts)
        centre = transform(inverse(about), view.centre[None])[0]
        order = shuffle(len(self.scan), draw)
        if view.is_socket:
            order = telling_order(self.scan.points, centre, view.radius_mm, draw)
        return self._finishers(view, centre, order, rotations, np.zeros((starts, 3)), NEAR_HEATS)

    def about(self, start: FloatArray) -> list[Candidate]:
        """Distinct minima within `START_CONE_DEG` of a start pose (4, 4), best first."""
        view = self._view_at(start)
        centre = transform(inverse(start), view.centre[None])[0]
        centres = sphere_centres(self.scan.points, self.towards, view.radius_mm) if view.is_socket else []
        near = [c for c in centres if np.linalg.norm(c - centre) < START_REACH_MM]
        anchors = np.array([*near, centre])
        found: list[Candidate] = []
        for draw in range(MAX_RACES):
            rotations = rotations_near(start[:3, :3], START_CONE_DEG, STARTS, draw * STARTS)
            shifts = _shifts(rotations, anchors)
            order = shuffle(len(self.scan), draw)
            if near:
                order = telling_order(self.scan.points, anchors[0], view.radius_mm, draw)
            found = merged(found, self._finishers(view, anchors[0], order, rotations, shifts), self.middle)
            if found[0].hits >= SURE_HITS:
                break
        return found

    def _raced(self, view: View, centres: list[FloatArray], draw: int) -> list[Candidate]:
        seen_from = ANYWHERE if view.whole else Cone(view.axis, SHELL_CONE_DEG + 5.0)
        rotations = rotations_within((seen_from, self.cone), self.towards, STARTS, draw * STARTS)
        if len(rotations) == 0:
            return []
        if view.whole:
            shifts = visible_centroids(self.model.surface, rotations @ self.towards) - view.centre
            return self._finishers(view, centres[0], shuffle(len(self.scan), draw), rotations, shifts)
        shifts = _shifts(rotations, np.array(centres))
        order = telling_order(self.scan.points, centres[0], view.radius_mm, draw)
        heats = HEATS if draw < PATIENT_DRAW else PATIENT_HEATS
        return self._finishers(view, centres[0], order, rotations, shifts, heats)

    def _finishers(
        self,
        view: View,
        centre: FloatArray,
        order: IntArray,
        rotations: FloatArray,
        shifts: FloatArray,
        heats: tuple[Heat, ...] = HEATS,
    ) -> list[Candidate]:
        cloud = Cloud.about(self.scan.points, self.scan.beams, centre, order)
        finishers = race(
            view, cloud, Poses(rotations.astype(np.float32), shifts.astype(np.float32)), self.stretch, heats
        )
        first, hits = distinct(finishers)
        points = np.ascontiguousarray((self.thin.points - centre).T, dtype=np.float32)
        beams = np.ascontiguousarray(self.thin.beams.T, dtype=np.float32)
        around, sigma = self.thin.around, self.sigma_mm
        polished, likelihood = polish(view.fine, finishers.at(first), points, beams, around, sigma)
        best = np.argsort(-likelihood, kind="stable")[:FINALISTS]
        polished, likelihood = polish(view.fine, polished.at(best), points, beams, around, sigma, (2, 3))
        hits = hits[best]
        rotation = polished.rotations.astype(np.float64)
        poses = pose(rotation, view.centre + polished.shifts - rotation @ centre)
        found = [Candidate(p, float(v), int(h), view) for p, v, h in zip(poses, likelihood, hits, strict=True)]
        return merged([], found, self.middle, bonus=0)

    def _view_at(self, start: FloatArray) -> View:
        """The prepared view that a start looks into, or one made for it."""
        aimed = transform(start, self.scan.points)
        middle = np.asarray(aimed.mean(axis=0), dtype=np.float64)
        towards = _unit(transform(start, self.scan.origin[None])[0] - middle)
        for view in self.model.views:
            if view.covers(aimed) < COVERED:
                continue
            faces_it = towards @ view.axis > np.cos(np.radians(SHELL_CONE_DEG))
            if view.fine.step_mm <= FINE_STEP_MM if view.whole else faces_it:
                return view
        reach = float(np.linalg.norm(aimed - middle, axis=1).max()) + 15.0
        return self.model.view_of(Place.of(middle, towards, reach))


def _shifts(rotations: FloatArray, anchors: FloatArray) -> FloatArray:
    """Shifts (K, 3) that bring the anchors (A, 3), taken in turn, to the view's centre; about the first anchor."""
    offsets = anchors[np.arange(len(rotations)) % len(anchors)] - anchors[0]
    return np.asarray(-(rotations @ offsets[..., None])[..., 0], dtype=np.float64)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
