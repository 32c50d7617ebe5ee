"""Finds the distinct minima of a registration: from anywhere, or about a start."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import StartError
from picoradar.registration.model import (
    SHELL_CONE_DEG,
    Model,
    Place,
    View,
    sphere_centres,
    sphere_support,
    visible_centroids,
)
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import inverse, small_motion, transform
from picoradar.registration.search.cone import ANYWHERE, Cone, rotations_within
from picoradar.registration.search.minima import SURE_HITS, Candidate, merged
from picoradar.registration.search.rotations import rotations_near
from picoradar.registration.search.successive_halving import (
    HEATS,
    NEAR_HEATS,
    PATIENT_HEATS,
    Heat,
    shuffle,
    telling_order,
)
from picoradar.registration.search.trials import Trials

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
        self.trials = Trials(scan, sigma_mm)
        self.middle = self.trials.middle

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
        if not any(len(self._rotations(view, 0)) for view in self.model.views):
            raise StartError("no hollow of the model opens to the cone of directions: widen it, or give a pose")
        found: list[Candidate] = []
        least = WHOLE_RACES if any(view.whole for view in self.model.views) else 1
        for draw in range(MAX_RACES):
            anchors = self.centres if draw == 0 else self.more_centres
            for index in self._likely_first():
                if anchors[index]:
                    found = self._joined(found, self._raced(self.model.views[index], anchors[index], draw), SURE_HITS)
                if draw == 0 and found and self._margin(found) > CLEAR:
                    break
            if not found:
                continue
            if self._margin(found) <= CLEAR or found[0].hits < MET_BY_MANY:
                found = self._joined(found, self._near(found, draw), 0)
            enough = self._margin(found) > CLEAR or (draw > 0 and self.sure(found))
            if enough and draw + 1 >= least:
                break
        if not found:
            raise StartError("no pose within the cone of directions explains the points: widen it, or search anywhere")
        return self._joined(found, self._turned(found[0]), 0) if found[0].view.whole else found

    def _joined(self, found: list[Candidate], more: list[Candidate], bonus: int) -> list[Candidate]:
        """Both lists in one, without what lies outside the cone."""
        inside = [c for c in more if self.cone.holds(c.model_from_scanner[:3, :3] @ self.towards, LEEWAY_DEG)]
        return merged(found, inside, self.middle, bonus)

    def _turned(self, best: Candidate) -> list[Candidate]:
        """The pose turned by quarters about the principal axes of the whole model.

        Manufactured bodies are symmetric, and a twin that no race happened to reach makes a pose no less ambiguous.
        """
        centroid, axes = self.model.surface.principal_frame
        quarters = [k * np.pi / 2.0 * axis for axis in axes.T for k in (1.0, 2.0, 3.0)]
        turns = [small_motion(np.concatenate([turn, np.zeros(3)]), centroid) for turn in quarters]
        poses = np.stack([turn @ best.model_from_scanner for turn in turns])
        return [replace(c, hits=0) for c in self.trials.polished(best.view, poses)]

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
        return (found[0].log_likelihood - found[1].log_likelihood) * len(self.trials.thin)

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
        return self.trials.raced(view, centre, order, rotations, np.zeros((starts, 3)), NEAR_HEATS)

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
            found = merged(
                found, self.trials.raced(view, anchors[0], order, rotations, shifts, _heats(draw)), self.middle
            )
            if self._margin(found) > CLEAR or (draw > 0 and self.sure(found)):
                break
        return found

    def _raced(self, view: View, centres: list[FloatArray], draw: int) -> list[Candidate]:
        rotations = self._rotations(view, draw)
        if len(rotations) == 0:
            return []
        if view.whole:
            shifts = visible_centroids(self.model.surface, rotations @ self.towards) - view.centre
            order = shuffle(len(self.scan), draw)
            return self.trials.raced(view, centres[0], order, rotations, shifts, PATIENT_HEATS)
        shifts = _shifts(rotations, np.array(centres))
        order = telling_order(self.scan.points, centres[0], view.radius_mm, draw)
        return self.trials.raced(view, centres[0], order, rotations, shifts, _heats(draw))

    def _rotations(self, view: View, draw: int) -> FloatArray:
        """Rotations (K, 3, 3) of a race: those that show the view, and that the scanner may look from."""
        seen_from = ANYWHERE if view.whole else Cone(view.axis, SHELL_CONE_DEG + 5.0)
        return rotations_within((seen_from, self.cone), self.towards, STARTS, draw * STARTS)

    def _view_at(self, start: FloatArray) -> View:
        """The prepared view that a start looks into, or one made for it."""
        aimed = transform(start, self.scan.points)
        middle = np.asarray(aimed.mean(axis=0), dtype=np.float64)
        towards = _unit(transform(start, self.scan.origin[None])[0] - middle)
        for view in self.model.views:  # what does not face the start is not asked for its fields
            faces_it = view.whole or towards @ view.axis > np.cos(np.radians(SHELL_CONE_DEG))
            if faces_it and view.covers(aimed) >= COVERED and not (view.whole and view.fine.step_mm > FINE_STEP_MM):
                return view
        reach = float(np.linalg.norm(aimed - middle, axis=1).max()) + 15.0
        return self.model.view_of(Place.of(middle, towards, reach))


def _heats(draw: int) -> tuple[Heat, ...]:
    return HEATS if draw < PATIENT_DRAW else PATIENT_HEATS


def _shifts(rotations: FloatArray, anchors: FloatArray) -> FloatArray:
    """Shifts (K, 3) that bring the anchors (A, 3), taken in turn, to the view's centre; about the first anchor."""
    offsets = anchors[np.arange(len(rotations)) % len(anchors)] - anchors[0]
    return np.asarray(-(rotations @ offsets[..., None])[..., 0], dtype=np.float64)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
