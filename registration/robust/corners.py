"""Poses in which corners of a model's flat faces change places: what fits one face may fit another.

Of a body with edges often little more is seen than a face and strips of its neighbours. That face may lie on any face,
and turned to any corner of it; the search, whose fields are rounded, may reach none of these poses. They are a finite
number: a frame at a corner of the face that the points lie on comes to lie on each such frame of the model.
"""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.model import FlatFace, Surface
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import transform
from picoradar.registration.settings import EdgeSettings


class Corners:
    """The flat faces of a model, for the points of a scan.

    Parameters
    ----------
    scan : Scan
    surface : Surface
    faces : list of FlatFace
        Of the surface.
    settings : EdgeSettings
    """

    def __init__(self, scan: Scan, surface: Surface, faces: list[FlatFace], settings: EdgeSettings) -> None:
        self.scan, self.surface, self.faces, self.settings = scan, surface, faces, settings
        self.face_of = np.full(len(surface.faces), len(faces))
        for number, face in enumerate(faces):
            self.face_of[face.triangles] = number

    def turned(self, pose: FloatArray) -> list[tuple[float, FloatArray]]:
        """Poses (4, 4) that lay a corner of the face with most points on a corner of the model, with their scores.

        A score is the mean distance in mm of some points, each cut off where it tells no more.
        """
        lies_on = self.face_of[self.surface.closest(transform(pose, self.scan.points)).faces]
        count = np.bincount(lies_on, minlength=len(self.faces) + 1)[:-1]
        if count.max(initial=0) == 0:
            return []  # on none of the flat faces
        main = int(np.argmax(count))
        back = np.linalg.inv(self.faces[main].frames)
        to = np.concatenate([face.frames for face in self.faces])
        moved = np.einsum("bkij,akjl->bakil", to, back).reshape(-1, 4, 4)
        poses = moved @ pose
        return list(zip(self._scores(poses, lies_on == main).tolist(), poses, strict=True))

    def _scores(self, poses: FloatArray, on_main: np.ndarray) -> FloatArray:
        half = self.settings.screened_points // 2
        some = np.concatenate([_spread(np.flatnonzero(on_main), half), _spread(np.flatnonzero(~on_main), half)])
        points = np.concatenate([transform(pose, self.scan.points[some]) for pose in poses])
        near = self.surface.closest(points)
        beams = np.concatenate([self.scan.beams[some] @ pose[:3, :3].T for pose in poses])
        off = np.abs(near.signed_mm)
        faces_away = np.einsum("ij,ij->i", self.surface.face_normals[near.faces], beams) > -self.settings.min_cosine
        far = self.settings.screening_mm
        return np.asarray(np.where(faces_away, far, np.minimum(off, far)).reshape(len(poses), -1).mean(axis=1))


def _spread(places: IntArray, count: int) -> IntArray:
    """About `count` of the places (N,), evenly spread."""
    return places[:: max(1, len(places) // count)][:count]
