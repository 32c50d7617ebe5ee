"""The global search: many starts race, the worse part drops out, and the rest go on with more points and finer fields.

A start is a rotation from a low-discrepancy sequence with the socket's centre found by consensus. All starts of a heat
take their Gauss-Newton steps together. Deterministic: no random number and no thread takes part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picoradar.registration._types import Float32Array, FloatArray, IntArray
from picoradar.registration.model import View
from picoradar.registration.search.batch import Poses, descended, scores


@dataclass(frozen=True)
class Heat:
    """One heat of the race.

    Attributes
    ----------
    points : int
        Points that take part.
    fine : bool
        Which field is read.
    least, most : int
        Poses that enter, the best at first sight of this heat's points; the first heat takes all.
    within : float
        Of these, beyond the `least`, only those enter whose loss a point is within this of the best one's.
    scales_mm : tuple of float
        Scale of the loss in each step; the first one also serves to rank.
    inside : float
        Largest loss inside bone, in units of the largest one in front of it.
    """

    points: int
    fine: bool
    least: int
    most: int
    within: float
    scales_mm: tuple[float, ...]
    inside: float

    def entrants(self, score: Float32Array) -> IntArray:
        """Who enters, best first, by the losses (K,) of all that want to."""
        order = np.argsort(score, kind="stable")
        close = int(np.searchsorted(score[order], score[order[0]] + self.within))
        return order[: min(max(close, self.least), self.most)]


HEATS = (
    Heat(160, False, 256, 256, np.inf, (1.4, 1.0), 25.0),
    Heat(200, False, 24, 96, 0.5, (1.0, 0.8, 0.7), 25.0),
    Heat(400, True, 12, 32, 0.4, (0.7, 0.7, 0.7), 25.0),
    Heat(800, True, 8, 12, 0.35, (0.7, 0.7, 0.7, 0.7), 25.0),
)
"""Margins: on simulated scans the start that wins is never more than 0.45, 0.32 and 0.28 behind as a heat begins."""

PATIENT_HEATS = (
    HEATS[0],
    replace(HEATS[1], most=256, within=np.inf),
    replace(HEATS[2], most=96, within=np.inf),
    replace(HEATS[3], most=36, within=np.inf),
)
"""Heats for scans that stay unclear: under much tissue the right start can fall far behind before it wins."""

RANKED_INSIDE = 5.0
"""Largest loss inside bone where poses are ranked."""

NEAR_HEATS = (
    Heat(250, True, 128, 128, np.inf, (1.0, 0.8, 0.7), 25.0),
    Heat(400, True, 6, 24, 0.25, (0.7, 0.7, 0.7), 25.0),
    Heat(800, True, 3, 8, 0.12, (0.7, 0.7, 0.7), 25.0),
)
"""Heats of a race about a minimum."""

STRATA_MM = (1.0, -1.0, -2.5)
"""Heights over the sphere that part the points: hollows beyond it, the sphere itself, low tissue, high tissue."""

STRATA_SHARES = (0.4, 0.5, 0.1, 0.02)
"""How the points that race are drawn from these strata."""


@dataclass(frozen=True)
class Cloud:
    """The points of a search: in the order in which heats take them, about the cloud's socket centre, float32.

    Attributes
    ----------
    centre : (3,) array
        Scanner frame, mm.
    points, beams : (3, N) arrays of float32
    """

    centre: FloatArray
    points: Float32Array
    beams: Float32Array

    @classmethod
    def about(cls, points: FloatArray, beams: FloatArray, centre: FloatArray, order: IntArray) -> Cloud:
        """Take points (N, 3) and beams (N, 3) in `order`."""
        return cls(
            centre=centre,
            points=np.ascontiguousarray((points - centre)[order].T, dtype=np.float32),
            beams=np.ascontiguousarray(beams[order].T, dtype=np.float32),
        )

    def first(self, count: int) -> tuple[Float32Array, Float32Array]:
        """The first `count` points and beams."""
        return np.ascontiguousarray(self.points[:, :count]), np.ascontiguousarray(self.beams[:, :count])


def shuffle(count: int, draw: int = 0) -> IntArray:
    """A permutation of `count` that is the same on every run; another one for every `draw`."""
    return np.random.default_rng(draw).permutation(count)


def telling_order(points: FloatArray, centre: FloatArray, radius_mm: float, draw: int = 0) -> IntArray:
    """Order points (N, 3) so that the first of them tell most about the rotation.

    On the sphere itself all rotations look alike; the hollows beyond it (fossa, notch, rim) tell them apart, and what
    stands far in front of it is tissue. So any first points hold fixed shares of these strata, as far as they reach.
    """
    order = shuffle(len(points), draw)
    height = (np.linalg.norm(points - centre, axis=1) - radius_mm)[order]
    stratum = (height[:, None] < np.array(STRATA_MM)).sum(axis=1)
    turn = np.empty(len(order))
    for index, share in enumerate(STRATA_SHARES):
        members = np.flatnonzero(stratum == index)
        turn[members] = (np.arange(len(members)) + 0.5) / share
    return order[np.argsort(turn, kind="stable")]


def race(view: View, cloud: Cloud, poses: Poses, stretch: float = 1.0, heats: tuple[Heat, ...] = HEATS) -> Poses:
    """Run the heats from `poses` and return the finishers, best first.

    Parameters
    ----------
    view : View
    cloud : Cloud
    poses : Poses
    stretch : float
        Factor on all scales of the loss, for noisier instruments.
    heats : tuple of Heat
    """
    for number, heat in enumerate(heats):
        points, beams = cloud.first(heat.points)
        field = view.fine if heat.fine else view.coarse
        if number > 0:
            score = scores(field, poses, points, beams, heat.scales_mm[0] * stretch, RANKED_INSIDE)
            poses = poses.at(heat.entrants(score))
        for scale in heat.scales_mm:
            poses = descended(field, poses, points, beams, scale * stretch, heat.inside)
    return poses


def distinct(poses: Poses, angle_rad: float = 0.035, shift_mm: float = 1.0) -> tuple[IntArray, IntArray]:
    """Indices of poses that differ from all earlier ones by `angle_rad` or `shift_mm`, and how many fell to each."""
    chosen: list[int] = []
    hits: list[int] = []
    for index in range(len(poses)):
        relative = poses.rotations[chosen] @ poses.rotations[index].T
        cosine = (np.trace(relative, axis1=1, axis2=2) - 1.0) / 2.0
        near = np.arccos(np.clip(cosine, -1.0, 1.0)) < angle_rad
        near &= np.linalg.norm(poses.shifts[chosen] - poses.shifts[index], axis=1) < shift_mm
        if near.any():
            hits[int(np.argmax(near))] += 1
        else:
            chosen.append(index)
            hits.append(1)
    return np.array(chosen, dtype=np.int64), np.array(hits, dtype=np.int64)
