"""Starts that lay the cloud on any place of a body: where no hollow says where to begin.

The surface in the middle of the cloud is laid on points drawn evenly from the model's surface, normal on normal, and
turned about it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.model import Surface
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import frame_about, rotation_from_vector
from picoradar.registration.settings import SearchSettings


class Patches(NamedTuple):
    """Starts: rotations (K, 3, 3), and where in the model frame (K, 3) mm the point `middle` (3,) comes to lie."""

    middle: FloatArray
    rotations: FloatArray
    places: FloatArray


def patches(scan: Scan, surface: Surface, number: int, settings: SearchSettings) -> Patches:
    """Return the starts of a round.

    Parameters
    ----------
    scan : Scan
    surface : Surface
        Of the model.
    number : int
        Of the round; each draws other places and another point of the cloud's middle.
    settings : SearchSettings
    """
    rng = np.random.default_rng([number])
    away = np.linalg.norm(scan.points - scan.points.mean(axis=0), axis=1)
    near = np.argsort(away, kind="stable")[: max(1, round(settings.middle_share * len(scan)))]
    middle, normal = _flat_patch(scan, scan.points[rng.choice(near, settings.middles)], settings.patch_mm)
    count = settings.patch_places
    chosen = rng.choice(len(surface.faces), count, p=surface.face_areas / surface.face_areas.sum())
    shares = rng.dirichlet(np.ones(3), size=count)
    places = np.einsum("kc,kcd->kd", shares, surface.vertices[surface.faces[chosen]])
    rolls = (np.arange(settings.patch_rolls) + rng.uniform()) * (2.0 * np.pi / settings.patch_rolls)
    turned = rotation_from_vector(np.stack([0 * rolls, 0 * rolls, rolls], axis=1)) @ frame_about(normal).T
    rotations = np.concatenate([frame_about(face) @ turned for face in surface.face_normals[chosen]])
    return Patches(middle, rotations, np.repeat(places, settings.patch_rolls, axis=0))


def _flat_patch(scan: Scan, middles: FloatArray, radius_mm: float) -> tuple[FloatArray, FloatArray]:
    """Return the flattest of some places (M, 3) of a cloud, and its normal towards the scanner."""
    best = (np.inf, middles[0], -scan.beams[0])
    for middle in middles:
        there = scan.points[np.linalg.norm(scan.points - middle, axis=1) < radius_mm]
        if len(there) < 3:
            continue
        _, spread, axes = np.linalg.svd(there - there.mean(axis=0), full_matrices=False)
        unevenness = float(spread[2] / np.sqrt(len(there)))
        if unevenness < best[0]:
            normal = axes[2] * -np.sign(axes[2] @ scan.beams.mean(axis=0))
            best = (unevenness, there.mean(axis=0), normal)
    return best[1], best[2]
