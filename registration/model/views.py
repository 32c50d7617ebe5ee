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

REACH_MM = 26.0
"""How far beyond the socket's sphere the fields reach: the rim and its surroundings are scanned too."""

MARGIN_MM = 10.0
"""Room about the bone, so that tissue in front of it lies inside the fields."""

WHOLE_STEPS = 90
"""Nodes along the longest edge of a whole model's field."""

SHELL_CONE_DEG = 30.0
"""A shell holds what can be seen from directions within this angle of the view's axis."""


BESIDE = "the start pose aims beside the model: no part of it is within reach of the points"

SEEN_RADII = 1.2
"""A socket's scan reaches so many radii from its centre."""

AS_SCANNED = 1500
"""Points drawn from a model to see it as a scan does."""

RADIUS_FACTORS = np.array([0.92, 0.96, 1.0, 1.04, 1.08])
"""Radii tried, as shares of that of the socket's fit."""

CELL_MM = 20.0
"""Starts that look at places nearer than this share a view."""

DIRECTIONS = 120
"""Directions that starts' views are seen along, some 18 deg apart."""


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
    """

    centre: FloatArray
    radius_mm: float
    axis: FloatArray
    make: Callable[[], Fields]
    whole: bool = False

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
    def is_socket(self) -> bool:
        """Whether the view is a socket, with a sphere to anchor a search."""
        return bool(np.isfinite(self.radius_mm))


def find_views(surface: Surface) -> tuple[View, ...]:
    """Find the sockets of a surface, likeliest first; without any, there is one view of the whole model."""
    return tuple(_socket_view(surface, socket) for socket in find_sockets(surface)) or (_whole_view(surface),)


def view_at(surface: Surface, centre: FloatArray, radius_mm: float, axis: FloatArray, whole: bool) -> View:
    """A view that :func:`find_views` found earlier on the same surface."""
    if whole:
        return _whole_view(surface)
    return View(centre, radius_mm, axis, partial(_shell_fields, surface, centre, axis, radius_mm + REACH_MM))


def _whole_view(surface: Surface) -> View:
    """The whole model, seen from any side, with a step that suits its size."""
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    centre = (low + high) / 2.0
    return View(centre, float("inf"), np.array([0.0, 0.0, 1.0]), partial(_whole_fields, surface, centre), whole=True)


def _whole_fields(surface: Surface, centre: FloatArray) -> Fields:
    moved = Surface(surface.vertices - centre, surface.faces, surface.border)
    low, high = moved.vertices.min(axis=0), moved.vertices.max(axis=0)
    step = max(1.0, float((high - low).max()) / WHOLE_STEPS)
    return build_fields(moved, low - MARGIN_MM, high + MARGIN_MM, step_mm=step)


def _socket_view(surface: Surface, socket: Socket) -> View:
    axis = opening(surface, socket)
    return view_at(surface, *as_scanned(surface, socket, axis), axis, whole=False)


def as_scanned(surface: Surface, socket: Socket, axis: FloatArray) -> tuple[FloatArray, float]:
    """Centre (3,) and radius of the socket's sphere as a scan from in front of it would show them.

    A socket that is no true sphere has no one centre: what counts is that model and scan agree on it, so it is found
    here as it is found there.
    """
    offset = surface.vertices[surface.faces].mean(axis=1) - socket.centre
    along = offset @ axis
    aside = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    reach = SEEN_RADII * socket.radius_mm
    facing = surface.face_normals @ axis
    seen = (facing > 0.1) & (aside < reach) & (np.abs(along) < reach)
    if not seen.any():
        return socket.centre, socket.radius_mm
    share = surface.face_areas[seen] * facing[seen]
    drawn = np.random.default_rng(0).choice(np.flatnonzero(seen), AS_SCANNED, p=share / share.sum())
    points = socket.centre + offset[drawn]
    best = (0.0, socket.centre, socket.radius_mm)
    for radius in socket.radius_mm * RADIUS_FACTORS:
        for centre in sphere_centres(points, axis, radius, 1):
            near = bool(np.linalg.norm(centre - socket.centre) < 0.5 * socket.radius_mm)
            support = sphere_support(points, centre, float(radius)) * near
            best = max(best, (support, centre, float(radius)), key=lambda found: found[0])
    return best[1], best[2]


@dataclass(frozen=True)
class Place:
    """A region that a start looks at, in steps, so that starts near each other share one view.

    Attributes
    ----------
    cell : tuple of three ints
        Centre, in steps of `CELL_MM`.
    direction : int
        Number of the nearest of `DIRECTIONS` evenly spread ones, towards the scanner.
    reach : int
        How far the region goes, in steps of `CELL_MM`.
    """

    cell: tuple[int, int, int]
    direction: int
    reach: int

    @classmethod
    def of(cls, centre: FloatArray, axis: FloatArray, reach_mm: float) -> Place:
        """The place that holds all within `reach_mm` of `centre` (3,) mm, seen along the unit vector `axis`."""
        x, y, z = (int(v) for v in np.rint(centre / CELL_MM))
        off = float(np.linalg.norm(centre - CELL_MM * np.array([x, y, z])))
        direction = int(np.argmax(sphere_directions(DIRECTIONS) @ axis))
        return cls((x, y, z), direction, int(np.ceil((reach_mm + off) / CELL_MM)))

    @property
    def name(self) -> str:
        """Name for the cache."""
        return "-".join(str(v) for v in (*self.cell, self.direction, self.reach))


def start_view(surface: Surface, place: Place) -> View:
    """A view of any region, whose fields can be made only where a part of the surface is (else `StartError`)."""
    axis, centre = sphere_directions(DIRECTIONS)[place.direction], CELL_MM * np.array(place.cell)
    return View(centre, float("inf"), axis, partial(_shell_fields, surface, centre, axis, CELL_MM * place.reach))


def _shell_fields(surface: Surface, centre: FloatArray, axis: FloatArray, reach: float) -> Fields:
    """Fields of what can be seen within `reach` of `centre` from the direction `axis`."""
    corners = surface.vertices[surface.faces]
    middle = corners.mean(axis=1)
    span = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    asked = np.linalg.norm(middle - centre, axis=1) < reach + MARGIN_MM + span
    if not asked.any():
        raise StartError(BESIDE)
    cropped = part(surface, asked)
    shell = visible_shell(surface, axis, SHELL_CONE_DEG, only=cropped)
    shell = Surface(shell.vertices - centre, shell.faces, shell.border)
    low, high = np.maximum(shell.vertices.min(axis=0), -reach), np.minimum(shell.vertices.max(axis=0), reach)
    if (low > high).any():  # of large faces the middles may be near enough, and no corner on this side
        raise StartError(BESIDE)
    return build_fields(shell, low - MARGIN_MM, high + MARGIN_MM)


def opening(surface: Surface, socket: Socket, rays: int = 400) -> FloatArray:
    """Unit vector (3,) through the middle of a socket's opening: the mean of the directions free of bone."""
    directions = sphere_directions(rays)
    distance = surface.first_hit(np.broadcast_to(socket.centre, directions.shape), directions)
    mean = directions[distance > 2.5 * socket.radius_mm].sum(axis=0)
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length if length > 1.0 else socket.axis, dtype=np.float64)


def sphere_directions(count: int) -> FloatArray:
    """Unit vectors (count, 3) spread evenly over the sphere (golden spiral)."""
    k = np.arange(count) + 0.5
    z, azimuth = 1.0 - 2.0 * k / count, k * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)
