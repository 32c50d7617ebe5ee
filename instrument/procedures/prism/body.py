"""The calibration prism of section 4.1.1: its model, and distances of points from it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

FloatArray = NDArray[np.float64]

HALF_MM = 20.0
"""Half of the base, and of the height: base at z = -20, ridge at z = 20 along y."""
VERTICES = np.array(
    [(x, y, -HALF_MM) for x in (-HALF_MM, HALF_MM) for y in (-HALF_MM, HALF_MM)]
    + [(0.0, -HALF_MM, HALF_MM), (0.0, HALF_MM, HALF_MM)]
)
FACES = np.array([(0, 1, 5), (0, 5, 4), (2, 4, 5), (2, 5, 3), (0, 4, 2), (1, 3, 5), (0, 2, 3), (0, 3, 1)])
ROWS, COLUMNS = 41, 81  # 1 mm along the ridge, and 1 mm in height
MARGIN_MM = 0.6  # the whole spot is on the body

SPLAT_MM = 1.0
SPLAT_THICKNESS_MM = 0.5
SPLAT_NEIGHBOURS = 24
SPLAT_REACH_MM = 4.0  # beyond, a splat has 3e-4 of its height
SPLAT_HEIGHTS_MM = np.arange(-1.0, 3.01, 0.05)


class Distances(NamedTuple):
    """Of measured points from the prism, mm: ``along`` the beam (N,) and ``perpendicular`` (N,), both positive on the
    scanner's side; ``splatted`` (M,), of the surface of the splatted points at the places of the model."""

    along: FloatArray
    perpendicular: FloatArray
    splatted: FloatArray


def model_points() -> FloatArray:
    """Return the points (41, 81, 3) of the model on its two faces."""
    half = HALF_MM - MARGIN_MM
    y, x = np.meshgrid(np.linspace(half, -half, ROWS), np.linspace(-half, half, COLUMNS), indexing="ij")
    return np.stack([x, y, HALF_MM - 2.0 * np.abs(x)], axis=-1)


def model_from_scanner_at(distance_mm: float) -> FloatArray:
    """Return the pose (4, 4) of a prism that faces the scanner with its middle at a distance on the beam at rest."""
    pose = np.diag([-1.0, 1.0, -1.0, 1.0])
    pose[2, 3] = distance_mm
    return pose


def distances(points: FloatArray, beams: FloatArray) -> Distances:
    """Compare points (N, 3) with the prism, both in its frame; ``beams`` (N, 3) are unit directions."""
    side = np.where(points[:, 0] >= 0, 1.0, -1.0)
    outward = np.column_stack([2.0 * side, np.zeros(len(points)), np.ones(len(points))]) / np.sqrt(5.0)
    perpendicular = (points * outward).sum(axis=1) - HALF_MM / np.sqrt(5.0)
    along = -perpendicular / (beams * outward).sum(axis=1)
    return Distances(along, perpendicular, splatted(points))


def splatted(points: FloatArray) -> FloatArray:
    """Return the distance from the model to the outer surface of the splatted points, at its inner places.

    Each point spreads a Gaussian into space (section 3.2.2); the surface is the level at which exact points of the
    same spacing would give a body `SPLAT_THICKNESS_MM` thick to each side. So it says as much of the splat as of the
    points: exact ones give 0.5 mm.
    """
    model = model_points().reshape(-1, 3)
    inner = (np.abs(model[:, 0]) > 3.0) & (np.abs(model[:, 0]) < 17.0) & (np.abs(model[:, 1]) < 17.0)
    origins = model[inner]
    side = np.sign(origins[:, 0])
    outward = np.column_stack([2.0 * side, np.zeros(len(origins)), np.ones(len(origins))]) / np.sqrt(5.0)
    level = _density(cKDTree(model), origins + SPLAT_THICKNESS_MM * outward).mean()
    tree = cKDTree(points)
    above = np.array([_density(tree, origins + height * outward) > level for height in SPLAT_HEIGHTS_MM])
    outermost = len(SPLAT_HEIGHTS_MM) - 1 - np.argmax(above[::-1], axis=0)
    return np.asarray(SPLAT_HEIGHTS_MM[outermost][above.any(axis=0)])


def _density(tree: cKDTree, places: FloatArray) -> FloatArray:
    distance, _ = tree.query(places, k=SPLAT_NEIGHBOURS, distance_upper_bound=SPLAT_REACH_MM)
    return np.asarray(np.exp(-0.5 * (distance / SPLAT_MM) ** 2).sum(axis=1))
