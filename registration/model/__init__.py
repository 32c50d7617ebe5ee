"""The preoperative model: mesh, closest points and rays, distance fields, what a scanner can see of it, cache."""

from picoradar.registration.model.cache_folder import CacheContents, clear_cache, contents_of_cache
from picoradar.registration.model.centres import sphere_centres, sphere_support
from picoradar.registration.model.field import DistanceField, build_fields
from picoradar.registration.model.files import load_model
from picoradar.registration.model.flat_faces import FlatFace, flat_faces
from picoradar.registration.model.prepared import Model, prepare_model
from picoradar.registration.model.surface import Closest, Surface, part
from picoradar.registration.model.views import Place, View
from picoradar.registration.model.visibility import visible_centroids, visible_shell

__all__ = [
    "CacheContents",
    "Closest",
    "DistanceField",
    "FlatFace",
    "Model",
    "Place",
    "Surface",
    "View",
    "build_fields",
    "clear_cache",
    "contents_of_cache",
    "flat_faces",
    "load_model",
    "part",
    "prepare_model",
    "sphere_centres",
    "sphere_support",
    "visible_centroids",
    "visible_shell",
]
