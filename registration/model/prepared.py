"""The model that points are registered to: a validated mesh with its search structures."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.model import cache
from picoradar.registration.model.curvature import principal_curvatures
from picoradar.registration.model.mesh import MeshReport, validated
from picoradar.registration.model.surface import Closest, Surface
from picoradar.registration.model.views import Place, View, find_views, start_view, view_at, whole_view
from picoradar.registration.settings import PreparationSettings


@dataclass(frozen=True)
class Model:
    """A prepared model; make one with :func:`prepare_model` or :func:`registration.load_model`.

    Attributes
    ----------
    surface : Surface
        Validated triangles with exact closest points.
    report : MeshReport
        What validation found and repaired.
    views : tuple of View
        Hollow regions that a scan can come from, ready to be searched.
    name : str
        Where it came from, for messages.
    key : str
        Digest of the mesh as given: views made for starts are kept on disk under it.
    made : dict
        Views made for starts so far.
    settings : PreparationSettings
        That it was prepared with.
    """

    surface: Surface
    report: MeshReport
    views: tuple[View, ...] = ()
    name: str = "model"
    key: str = ""
    made: dict[Place, View] = field(default_factory=dict, repr=False)
    settings: PreparationSettings = field(default_factory=PreparationSettings, repr=False)

    @property
    def vertices(self) -> FloatArray:
        """Vertices (V, 3) mm."""
        return self.surface.vertices

    @property
    def faces(self) -> IntArray:
        """Triangles (F, 3), counter-clockwise seen from outside."""
        return self.surface.faces

    @property
    def normals(self) -> FloatArray:
        """Angle-weighted unit normals of the vertices (V, 3)."""
        return self.surface.vertex_normals

    @cached_property
    def curvatures(self) -> FloatArray:
        """Largest and smallest curvature (V, 2) in 1/mm, see `model.curvature`; kept on disk, too.

        For those who choose points or judge a model: the solvers take the surface itself, not its curvature.
        """
        make = partial(principal_curvatures, self.surface)
        return cache.kept_array(f"{self.key}-curvatures", make) if self.key else make()

    @property
    def closed(self) -> bool:
        """Whether the surface encloses a volume."""
        return self.report.closed

    @property
    def centre(self) -> FloatArray:
        """Centre of the bounding box (3,) mm."""
        return np.asarray((self.vertices.max(axis=0) + self.vertices.min(axis=0)) / 2.0, dtype=np.float64)

    @property
    def size_mm(self) -> float:
        """Diagonal of the bounding box."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def closest(self, points: FloatArray) -> Closest:
        """Exact closest points of `points` (N, 3) mm in the model frame."""
        return self.surface.closest(points)

    @cached_property
    def whole(self) -> View:
        """The whole model, seen from any side; its fields are made when first asked for and then kept, on disk too."""
        view = whole_view(self.surface, self.settings.view, fine=True)
        return _kept(replace(view, smooth=any(one.is_socket for one in self.views)), self.key, "whole")

    def view_of(self, place: Place) -> View:
        """View of any place, made when first asked for and then kept, on disk too.

        Raises
        ------
        StartError
            If no part of the model is there.
        """
        if place not in self.made:
            view = _kept(start_view(self.surface, place, self.settings.view), self.key, place.name)
            _ = view.fields  # refused here if nothing is there
            self.made[place] = view
        return self.made[place]


def _kept(view: View, key: str, name: str) -> View:
    """The view with its fields kept on disk, for models that have a key."""
    return replace(view, make=partial(cache.kept_fields, f"{key}-{name}", view.make)) if key else view


def prepare_model(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    name: str = "model",
    settings: PreparationSettings | None = None,
) -> Model:
    """Validate a mesh and prepare it for registration.

    The result is kept on disk by content (see `model.cache`), so that the same mesh is ready at once
    the next time.

    Parameters
    ----------
    vertices : (V, 3) array
        Millimetres.
    faces : (F, 3) array of int
        Counter-clockwise seen from outside.
    name : str
        For messages.
    settings : PreparationSettings, optional

    Raises
    ------
    MeshError
        See :func:`picoradar.registration.model.mesh.validated`.

    Examples
    --------
    >>> from picoradar import prepare_model
    >>> corners = [[0, 0, 0], [60, 0, 0], [0, 40, 0], [10, 10, 50]]
    >>> model = prepare_model(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], name="wedge")
    >>> model.closed
    True
    """
    chosen = settings or PreparationSettings()
    given_vertices, given_faces = np.asarray(vertices), np.asarray(faces)
    key = _key(cache.digest(given_vertices, given_faces), chosen)
    if (kept := kept_model(key, name, chosen)) is not None:
        return kept
    v, f, report = validated(given_vertices, given_faces)
    surface = _surface(v, f, report)
    views = find_views(surface, chosen)
    cache.store(key, cache.Prepared(v, f, report, tuple(map(_place, views)), views[0].fields))
    return _model(surface, report, views, name, key, chosen)


def kept_model(key: str, name: str, settings: PreparationSettings | None = None) -> Model | None:
    """Prepared model of a mesh with this key, from the disk; None when it is not there."""
    prepared = cache.load(key)
    if prepared is None:
        return None
    chosen = settings or PreparationSettings()
    surface = _surface(prepared.vertices, prepared.faces, prepared.report)
    likeliest, *others = (
        view_at(surface, *place[:3], whole=place[3], settings=chosen.view) for place in prepared.places
    )
    views = (replace(likeliest, make=prepared.likeliest), *others)
    return _model(surface, prepared.report, views, name, key, chosen)


def _key(digest: str, settings: PreparationSettings) -> str:
    """Key of a prepared model: the digest of its mesh, and of settings that are not the usual ones."""
    if settings == PreparationSettings():
        return digest
    return f"{digest}-{hashlib.sha256(repr(settings).encode()).hexdigest()[:16]}"


def _surface(vertices: FloatArray, faces: IntArray, report: MeshReport) -> Surface:
    """The surface; a border is looked for only where validation found one."""
    return Surface(vertices, faces, None if report.open_edges else np.zeros(faces.shape, dtype=np.bool_))


def _model(
    surface: Surface,
    report: MeshReport,
    views: tuple[View, ...],
    name: str,
    key: str,
    settings: PreparationSettings,
) -> Model:
    """The model; fields of all views but the likeliest are kept on disk when they are first needed."""
    likeliest, *others = views
    kept = (likeliest, *(_kept(view, key, str(index)) for index, view in enumerate(others, start=1)))
    return Model(surface=surface, report=report, views=kept, name=name, key=key, settings=settings)


def _place(view: View) -> cache.HollowPlace:
    return view.centre, view.radius_mm, view.axis, view.whole
