"""Where a search starts: the hollows' centres in the cloud, rotations about them, and the view that a pose needs."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.model import Model, Place, View, sphere_centres, sphere_support
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import transform
from picoradar.registration.search.cone import ANYWHERE, Cone, rotations_within
from picoradar.registration.settings import RobustSettings


class Starts:
    """Starts of a search for the poses of a scan.

    Parameters
    ----------
    scan : Scan
    model : Model
    cone : Cone
        Directions that the scanner may look from.
    settings : RobustSettings

    Attributes
    ----------
    towards : (3,) array
        Unit vector from the cloud to the scanner, scanner frame.
    middle : (3,) array
        Mean of the points, scanner frame, mm.
    """

    def __init__(self, scan: Scan, model: Model, cone: Cone, settings: RobustSettings) -> None:
        self.scan, self.model, self.cone, self.settings = scan, model, cone, settings
        self.towards = unit(-scan.beams.mean(axis=0))
        self.middle = np.asarray(scan.points.mean(axis=0), dtype=np.float64)

    def sphere_centres(self, radius_mm: float, count: int | None = None) -> list[FloatArray]:
        """Centres (3,) of spheres of this radius in the cloud, scanner frame, mm, best first."""
        return sphere_centres(self.scan.points, self.towards, radius_mm, self.settings.sphere, count)

    @cached_property
    def centres(self) -> list[list[FloatArray]]:
        """Centres of each view's sphere in the scanner frame; of the whole model, the cloud's middle."""
        return [[self.middle] if view.whole else self.sphere_centres(view.radius_mm) for view in self.model.views]

    @cached_property
    def more_centres(self) -> list[list[FloatArray]]:
        """The same for spheres a little smaller and larger, too: sockets are no true spheres."""
        search = self.settings.search
        return [
            centres
            if view.whole
            else centres
            + [
                centre
                for factor in search.other_radii
                for centre in self.sphere_centres(factor * view.radius_mm, search.other_radius_centres)
            ]
            for view, centres in zip(self.model.views, self.centres, strict=True)
        ]

    @cached_property
    def support(self) -> list[float]:
        """Share of the cloud that lies on each view's sphere; 0 of a view without one."""
        return [
            sphere_support(self.scan.points, centres[0], view.radius_mm, self.settings.sphere)
            if centres and view.is_socket
            else 0.0
            for view, centres in zip(self.model.views, self.centres, strict=True)
        ]

    def likely_first(self) -> list[int]:
        """Numbers of the views by how much of the cloud lies on their spheres."""
        return [int(k) for k in np.argsort(-np.array(self.support), kind="stable")]

    def alike(self, one: int, other: int) -> bool:
        """Whether the spheres of two views hold so nearly as much of the cloud that either may be what was scanned."""
        return self.support[other] > self.settings.search.alike_support * self.support[one]

    def rotations(self, view: View, number: int) -> FloatArray:
        """Rotations (K, 3, 3) of a round: those that show the view, and that the scanner may look from."""
        search = self.settings.search
        opening_deg = self.model.settings.view.shell_cone_deg + search.view_margin_deg
        seen_from = ANYWHERE if view.whole else Cone(view.axis, opening_deg)
        return rotations_within((seen_from, self.cone), self.towards, search.starts, number * search.starts)

    def view_at(self, start: FloatArray) -> View:
        """The prepared view that a start (4, 4) looks into, or one made for it."""
        search, shell_cone_deg = self.settings.search, self.model.settings.view.shell_cone_deg
        aimed = transform(start, self.scan.points)
        middle = np.asarray(aimed.mean(axis=0), dtype=np.float64)
        towards = unit(transform(start, self.scan.origin[None])[0] - middle)
        for view in self.model.views:  # what does not face the start is not asked for its fields
            faces_it = view.whole or towards @ view.axis > np.cos(np.radians(shell_cone_deg))
            if (
                faces_it
                and view.covers(aimed) >= search.min_covered_share
                and not (view.whole and view.fine.step_mm > search.max_start_step_mm)
            ):
                return view
        reach = float(np.linalg.norm(aimed - middle, axis=1).max()) + search.start_margin_mm
        return self.model.view_of(Place.of(middle, towards, reach, self.model.settings.view))


def shifts_to(rotations: FloatArray, anchors: FloatArray) -> FloatArray:
    """Shifts (K, 3) that bring the anchors (A, 3), taken in turn, to the view's centre; about the first anchor."""
    offsets = anchors[np.arange(len(rotations)) % len(anchors)] - anchors[0]
    return np.asarray(-(rotations @ offsets[..., None])[..., 0], dtype=np.float64)


def unit(vector: FloatArray) -> FloatArray:
    """The vector (3,) at length one."""
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
