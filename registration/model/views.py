"""Views of a model: the hollow regions that a scan can come from, each with its visible shell and distance fields.

A closed bone is a trap for any search: points lock onto the far wall. So a view keeps only the faces that a scanner in
front of the hollow can see, and its fields are signed against these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import StartError
from picoradar.registration.model.centres import sphere_centres, sphere_support
from picoradar.registration.model.field import DistanceField, build_fields
from picoradar.registration.model.hollows import Socket, find_sockets
from picoradar.registration.model.surface import Surface, part
from picoradar.registration.model.visibility import visible_shell
from picoradar.registration.settings import PreparationSettings, ViewSettings

OFF_MODEL = "the start pose aims beside the model: no part of it is within reach of the points"

Fields = tuple[DistanceField, DistanceField]
"""A fine field and a coarse one."""


@dataclass(frozen=True)
class View:
    """One region of a model with what a search needs.

    Attributes
    ----------
    centre : (3,) array
        Origin of the fields' frame: the socket's centre in the model frame, mm. Axes are the model's.
    radius_mm : float
        Of the socket's sphere.
    axis : (3,) array
        Unit vector through the middle of the opening, towards where a scanner would be.
    make : callable
        Makes the fields, or fetches them, when they are first read.
    whole : bool
        The view is the whole model, seen from any side; then `axis` means nothing.
    smooth : bool
        Of a body with hollows, a bone: no sharp edges hold a pose on it.
    """

    centre: FloatArray
    radius_mm: float
    axis: FloatArray
    make: Callable[[], Fields]
    whole: bool = False
    smooth: bool = False

    @cached_property
    def fields(self) -> Fields:
        """Fields of the visible shell, about `centre`."""
        return self.make()

    @property
    def fine(self) -> DistanceField:
        """The fine field."""
        return self.fields[0]

    @property
    def coarse(self) -> DistanceField:
        """The coarse field."""
        return self.fields[1]

    def covers(self, points: FloatArray) -> float:
        """Share of `points` (N, 3), model frame, that lie inside the fields' box."""
        at = (points - self.centre - self.fine.low) / self.fine.step_mm
        inside = (at >= 0.0) & (at <= np.array(self.fine.shape) - 1.0)
        return float(inside.all(axis=1).mean())

    @property
    def edges(self) -> bool:
        """Whether sharp edges, which the fields round, may hold a pose."""
        return not (self.is_socket or self.smooth)

    @property
    def is_socket(self) -> bool:
        """Whether the view is a socket, with a sphere to anchor a search."""
        return bool(np.isfinite(self.radius_mm))


def find_views(surface: Surface, settings: PreparationSettings) -> tuple[View, ...]:
    """Find the sockets of a surface, likeliest first; without any, there is one view of the whole model."""
    sockets = find_sockets(surface, settings.hollow)
    whole = whole_view(surface, settings.view)
    return tuple(_socket_view(surface, socket, settings) for socket in sockets) or (whole,)


def view_at(
    surface: Surface, centre: FloatArray, radius_mm: float, axis: FloatArray, *, whole: bool, settings: ViewSettings
) -> View:
    """A view that :func:`find_views` found earlier on the same surface."""
    if whole:
        return whole_view(surface, settings)
    make = partial(_shell_fields, surface, centre, axis, radius_mm + settings.reach_mm, settings)
    return View(centre, radius_mm, axis, make)


def whole_view(surface: Surface, settings: ViewSettings, *, fine: bool = False) -> View:
    """The whole model, seen from any side, with a step that suits its size; a shorter one where it is to be `fine`."""
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    centre = (low + high) / 2.0
    make = partial(_whole_fields, surface, centre, settings, fine=fine)
    return View(centre, float("inf"), np.array([0.0, 0.0, 1.0]), make, whole=True)


def _whole_fields(surface: Surface, centre: FloatArray, settings: ViewSettings, *, fine: bool) -> Fields:
    moved = Surface(surface.vertices - centre, surface.faces, surface.border)
    low, high = moved.vertices.min(axis=0), moved.vertices.max(axis=0)
    margin = settings.margin_mm
    step = float((high - low).max()) / settings.whole_steps
    if fine:
        step = float(np.cbrt(np.prod(high - low + 2.0 * margin) / settings.whole_nodes))
    step = max(settings.field_step_mm, step)
    return build_fields(moved, low - margin, high + margin, step_mm=step, band_mm=settings.field_band_mm)


def _socket_view(surface: Surface, socket: Socket, settings: PreparationSettings) -> View:
    axis = opening(surface, socket, settings.view)
    centre, radius_mm = as_scanned(surface, socket, axis, settings)
    return view_at(surface, centre, radius_mm, axis, whole=False, settings=settings.view)


def as_scanned(
    surface: Surface, socket: Socket, axis: FloatArray, settings: PreparationSettings
) -> tuple[FloatArray, float]:
    """Centre (3,) and radius of the socket's sphere as a scan from in front of it would show them.

    A socket that is no true sphere has no one centre: what counts is that model and scan agree on it, so it is found
    here as it is found there.
    """
    view = settings.view
    offset = surface.vertices[surface.faces].mean(axis=1) - socket.centre
    along = offset @ axis
    aside = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    reach = view.seen_radii * socket.radius_mm
    facing = surface.face_normals @ axis
    seen = (facing > view.seen_min_cosine) & (aside < reach) & (np.abs(along) < reach)
    if not seen.any():
        return socket.centre, socket.radius_mm
    share = surface.face_areas[seen] * facing[seen]
    drawn = np.random.default_rng(0).choice(np.flatnonzero(seen), view.seen_points, p=share / share.sum())
    points = socket.centre + offset[drawn]
    max_shift = view.max_centre_shift_radii * socket.radius_mm
    best = (0.0, socket.centre, socket.radius_mm)
    for radius in socket.radius_mm * np.array(view.radius_factors):
        for centre in sphere_centres(points, axis, radius, settings.sphere, 1):
            near = bool(np.linalg.norm(centre - socket.centre) < max_shift)
            support = sphere_support(points, centre, float(radius), settings.sphere) * near
            best = max(best, (support, centre, float(radius)), key=lambda found: found[0])
    return best[1], best[2]


@dataclass(frozen=True)
class Place:
    """A region that a start looks at, in steps, so that starts near each other share one view.

    Attributes
    ----------
    cell : tuple of three ints
        Centre, in steps of `cell_mm`.
    direction : int
        Number of the nearest of `directions` evenly spread ones, towards the scanner.
    reach : int
        How far the region goes, in steps of `cell_mm`.
    """

    cell: tuple[int, int, int]
    direction: int
    reach: int

    @classmethod
    def of(cls, centre: FloatArray, axis: FloatArray, reach_mm: float, settings: ViewSettings) -> Place:
        """The place that holds all within `reach_mm` of `centre` (3,) mm, seen along the unit vector `axis`."""
        cell_mm = settings.cell_mm
        x, y, z = (int(v) for v in np.rint(centre / cell_mm))
        off = float(np.linalg.norm(centre - cell_mm * np.array([x, y, z])))
        direction = int(np.argmax(sphere_directions(settings.directions) @ axis))
        return cls((x, y, z), direction, int(np.ceil((reach_mm + off) / cell_mm)))

    @property
    def name(self) -> str:
        """Name for the cache."""
        return "-".join(str(v) for v in (*self.cell, self.direction, self.reach))


def start_view(surface: Surface, place: Place, settings: ViewSettings) -> View:
    """A view of any region, whose fields can be made only where a part of the surface is (else `StartError`)."""
    axis = sphere_directions(settings.directions)[place.direction]
    centre, reach = settings.cell_mm * np.array(place.cell), settings.cell_mm * place.reach
    return View(centre, float("inf"), axis, partial(_shell_fields, surface, centre, axis, reach, settings))


def _shell_fields(
    surface: Surface, centre: FloatArray, axis: FloatArray, reach: float, settings: ViewSettings
) -> Fields:
    """Fields of what can be seen within `reach` of `centre` from the direction `axis`."""
    margin = settings.margin_mm
    corners = surface.vertices[surface.faces]
    middle = corners.mean(axis=1)
    span = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    within = np.linalg.norm(middle - centre, axis=1) < reach + margin + span
    if not within.any():
        raise StartError(OFF_MODEL)
    cropped = part(surface, within)
    shell = visible_shell(surface, axis, settings.shell_cone_deg, only=cropped, min_cosine=settings.min_seen_cosine)
    shell = Surface(shell.vertices - centre, shell.faces, shell.border)
    low, high = np.maximum(shell.vertices.min(axis=0), -reach), np.minimum(shell.vertices.max(axis=0), reach)
    if (low > high).any():  # of large faces the middles may be near enough, and no corner on this side
        raise StartError(OFF_MODEL)
    step, band = settings.field_step_mm, settings.field_band_mm
    return build_fields(shell, low - margin, high + margin, step_mm=step, band_mm=band)


def opening(surface: Surface, socket: Socket, settings: ViewSettings) -> FloatArray:
    """Unit vector (3,) through the middle of a socket's opening: the mean of the directions free of bone."""
    directions = sphere_directions(settings.opening_rays)
    distance = surface.first_hit(np.broadcast_to(socket.centre, directions.shape), directions)
    mean = directions[distance > settings.opening_radii * socket.radius_mm].sum(axis=0)
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length if length > settings.opening_min_directions else socket.axis, dtype=np.float64)


def sphere_directions(count: int) -> FloatArray:
    """Unit vectors (count, 3) spread evenly over the sphere (golden spiral)."""
    k = np.arange(count) + 0.5
    z, azimuth = 1.0 - 2.0 * k / count, k * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)
