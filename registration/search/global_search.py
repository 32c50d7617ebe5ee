"""Finds the distinct minima of a registration: from anywhere, or about a start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.errors import StartError
from picoradar.registration.model import Model, View, visible_centroids
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import inverse, small_motion, transform
from picoradar.registration.search.cone import ANYWHERE, Cone
from picoradar.registration.search.descent import Descent
from picoradar.registration.search.minima import Candidate, merged
from picoradar.registration.search.patches import patches
from picoradar.registration.search.rotations import rotations_near
from picoradar.registration.search.starts import Starts, shifts_to
from picoradar.registration.search.successive_halving import shuffled, stratified_order
from picoradar.registration.settings import RobustSettings, Stage


class Search:
    """Searches a model for the poses that explain a scan.

    Parameters
    ----------
    scan : Scan
    model : Model
    sigma_mm : float
        Noise along the beam.
    settings : RobustSettings
    cone : Cone, optional
        Directions that the scanner may look from.
    """

    def __init__(
        self, scan: Scan, model: Model, sigma_mm: float, settings: RobustSettings, cone: Cone = ANYWHERE
    ) -> None:
        self.scan, self.model, self.sigma_mm, self.settings = scan, model, sigma_mm, settings
        self.starts = Starts(scan, model, cone, settings)
        self.descent = Descent(scan, sigma_mm, settings)
        self.middle = self.starts.middle

    def from_anywhere(self) -> list[Candidate]:
        """Distinct minima, best first; rounds are run until the best one is trusted.

        Raises
        ------
        StartError
            If no pose of the cone explains the points.
        """
        search = self.settings.search
        min_rounds = search.whole_min_rounds if any(view.whole for view in self.model.views) else 1
        found: list[Candidate] = []
        for number in range(search.max_rounds):
            # 1. Successive halving of starts in every hollow, the likeliest first.
            found = self._all_views(found, number)
            if not found:
                continue
            # 2. A closer look about the best minimum, unless it is clear and many starts ended there.
            if not self._clear(found) or found[0].hits < search.well_met_hits:
                found = self.joined(found, self._near_best(found, number))
            # 3. Other starts, points and spheres in a further round, until the best is clear or has won again.
            if number + 1 >= min_rounds and (self._clear(found) or (number > 0 and self.confident(found))):
                break
        # 4. Where no hollow explains the points, they may have been taken elsewhere on the body.
        if self._poor(found):
            for number in range(search.whole_min_rounds):
                found = self.joined(found, self._anywhere_on_body(number))
                if found and not self._poor(found):
                    break
        if not found:
            raise StartError("no pose within the cone of directions explains the points: widen it, or search anywhere")
        return found

    def about(self, start: FloatArray) -> list[Candidate]:
        """Distinct minima within `start_cone_deg` of a start pose (4, 4), best first, and the start itself."""
        search = self.settings.search
        view = self.starts.view_at(start)
        centre = transform(inverse(start), view.centre[None])[0]
        centres = self.starts.sphere_centres(view.radius_mm) if view.is_socket else []
        near = [c for c in centres if np.linalg.norm(c - centre) < search.start_reach_mm]
        anchors = np.array([*near, centre])
        found: list[Candidate] = []
        for number in range(search.max_rounds):
            rotations = rotations_near(start[:3, :3], search.start_cone_deg, search.starts, number * search.starts)
            shifts = shifts_to(rotations, anchors)
            order = self._order(view, anchors[0], number, stratified=bool(near))
            more = self.descent.from_starts(view, anchors[0], order, rotations, shifts, self._stages(number))
            found = merged(found, more, self.middle, search, bonus=search.confident_hits)
            if self._clear(found) or (number > 0 and self.confident(found)):
                break
        given = [self.descent.rated(view, start)]
        return merged(found, given, self.middle, search) if view.is_socket else [*found, *given]

    def near(self, solved: FloatArray) -> list[Candidate]:
        """Distinct minima near a pose (4, 4) that other points led to, best first."""
        search = self.settings.search
        view = self.starts.view_at(solved)
        return self._near(solved, view, search.clear_near_deg, search.clear_near_starts, 0)

    def confident(self, found: list[Candidate]) -> bool:
        """Whether the best minimum was met often enough, or stands out so clearly, that no better one was missed."""
        return found[0].hits >= self.settings.search.confident_hits or self._clear(found)

    def _poor(self, found: list[Candidate]) -> bool:
        """Whether the best minimum explains so few of the points, and so little better than the next, that the truth
        may lie elsewhere."""
        search = self.settings.search
        if not found:
            return True
        next_best = found[1].log_likelihood if found[1:] else -np.inf
        margin_nats = (found[0].log_likelihood - next_best) * len(self.descent.thin)
        return found[0].log_likelihood < search.poor_log_likelihood and margin_nats < search.poor_nats

    def _clear(self, found: list[Candidate]) -> bool:
        """Whether the best minimum explains all points much better than the next."""
        if len(found) < 2:
            return True
        margin_nats = (found[0].log_likelihood - found[1].log_likelihood) * len(self.descent.thin)
        return margin_nats > self.settings.search.clear_nats

    def joined(self, found: list[Candidate], more: list[Candidate], *, bonus: int = 0) -> list[Candidate]:
        """Both lists in one, without what lies outside the cone."""
        search, cone, towards = self.settings.search, self.starts.cone, self.starts.towards
        inside = [c for c in more if cone.holds(c.model_from_scanner[:3, :3] @ towards, search.cone_margin_deg)]
        return merged(found, inside, self.middle, search, bonus=bonus)

    def _all_views(self, found: list[Candidate], number: int) -> list[Candidate]:
        """The minima found, with those of a further round.

        The first round leaves out the hollows whose spheres fit the cloud worse than that of one with a clear minimum.
        Hollows that fit as well are raced: the other hip, or the same bone again, has to be seen to be ruled out.
        """
        anchors = self.starts.centres if number == 0 else self.starts.more_centres
        order = self.starts.likely_first()
        for place, index in enumerate(order):
            if place and number == 0 and found and self._clear(found) and not self.starts.alike(order[0], index):
                break
            if anchors[index]:
                more = self._round(self.model.views[index], anchors[index], number)
                found = self.joined(found, more, bonus=self.settings.search.confident_hits)
        return found

    def _round(self, view: View, centres: list[FloatArray], number: int) -> list[Candidate]:
        """Candidates of one round on one view."""
        rotations = self.starts.rotations(view, number)
        if len(rotations) == 0:
            return []
        if view.whole:
            shifts = visible_centroids(self.model.surface, rotations @ self.starts.towards) - view.centre
            stages = self.settings.search.patient_stages
        else:
            shifts, stages = shifts_to(rotations, np.array(centres)), self._stages(number)
        order = self._order(view, centres[0], number, stratified=not view.whole)
        return self.descent.from_starts(view, centres[0], order, rotations, shifts, stages)

    def _anywhere_on_body(self, number: int) -> list[Candidate]:
        """Candidates of one round on the whole model, from starts all over its surface."""
        search, view = self.settings.search, self.model.whole
        middle, rotations, places = patches(self.scan, self.model.surface, number, search)
        facing = [self.starts.cone.holds(turn @ self.starts.towards, search.cone_margin_deg) for turn in rotations]
        order = shuffled(len(self.scan), number)
        shifts = (places - view.centre)[facing]
        return self.descent.from_starts(view, middle, order, rotations[facing], shifts, search.patch_stages)

    def _near_best(self, found: list[Candidate], number: int) -> list[Candidate]:
        """Minima about the best one: a narrow look where it is clear, a wide one where others are nearly as good."""
        search, best = self.settings.search, found[0]
        half_angle_deg, starts = search.unclear_near_deg, search.unclear_near_starts
        if self._clear(found):
            half_angle_deg, starts = search.clear_near_deg, search.clear_near_starts
        near = self._near(best.model_from_scanner, best.view, half_angle_deg, starts, number)
        return [replace(c, hits=0) for c in near]

    def _near(self, about: FloatArray, view: View, half_angle_deg: float, starts: int, number: int) -> list[Candidate]:
        """Minima within a half angle of a pose (4, 4)."""
        rotations = rotations_near(about[:3, :3], half_angle_deg, starts, number * starts)
        centre = transform(inverse(about), view.centre[None])[0]
        order = self._order(view, centre, number, stratified=view.is_socket)
        stages = self.settings.search.near_stages
        return self.descent.from_starts(view, centre, order, rotations, np.zeros((starts, 3)), stages)

    def quarter_turns(self, best: Candidate) -> FloatArray:
        """The pose turned by quarters about the principal axes of the whole model, and of the cloud, (18, 4, 4).

        Manufactured bodies are symmetric, and so may be what is seen of others; a symmetry-equivalent pose that no
        round happened to reach makes a pose no less ambiguous.
        """
        seen = transform(best.model_from_scanner, self.descent.thin.points)
        middle = np.asarray(seen.mean(axis=0), dtype=np.float64)
        about_cloud = middle, np.linalg.eigh((seen - middle).T @ (seen - middle))[1]
        turns = [
            small_motion(np.concatenate([k * np.pi / 2.0 * axis, np.zeros(3)]), centre)
            for centre, axes in (self.model.surface.principal_frame, about_cloud)
            for axis in axes.T
            for k in (1.0, 2.0, 3.0)
        ]
        return np.stack([turn @ best.model_from_scanner for turn in turns])

    def _order(self, view: View, centre: FloatArray, number: int, *, stratified: bool) -> IntArray:
        """Order (N,) in which the stages of a round take the points."""
        if not stratified:
            return shuffled(len(self.scan), number)
        return stratified_order(self.scan.points, centre, view.radius_mm, number, self.settings.search)

    def _stages(self, number: int) -> tuple[Stage, ...]:
        """Stages of a round on a hollow."""
        search = self.settings.search
        return search.stages if number < search.patient_round else search.patient_stages
