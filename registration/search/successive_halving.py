"""Successive halving: all starts descend, the worse part drops out, the rest go on with more points and finer fields.

A start is a rotation from a low-discrepancy sequence with the socket's centre found by consensus. All poses of a stage
take their Gauss-Newton steps together. Deterministic: no unseeded random number and no thread takes part.

References
----------
Jamieson, Talwalkar, AISTATS (2016): successive halving. Li et al., JMLR 18:185 (2018).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import Float32Array, FloatArray, IntArray
from picoradar.registration.model import View
from picoradar.registration.search.field_factor import Beams, OneSidedLoss, Poses, descended, scores
from picoradar.registration.settings import RobustSettings, SearchSettings, Stage


@dataclass(frozen=True)
class Cloud:
    """The points of a search, in the order in which stages take them, about the cloud's socket centre.

    Attributes
    ----------
    centre : (3,) array
        Scanner frame, mm.
    beams : Beams
    """

    centre: FloatArray
    beams: Beams

    @classmethod
    def about(cls, points: FloatArray, beams: FloatArray, centre: FloatArray, order: IntArray) -> Cloud:
        """Take points (N, 3) and beams (N, 3) in `order`."""
        return cls(centre, Beams.of((points - centre)[order], beams[order]))


def shuffled(count: int, seed: int) -> IntArray:
    """A permutation of `count` that is the same on every run; another one for every `seed`."""
    return np.random.default_rng(seed).permutation(count)


def stratified_order(
    points: FloatArray, centre: FloatArray, radius_mm: float, seed: int, settings: SearchSettings
) -> IntArray:
    """Order points (N, 3) so that the first of them tell most about the rotation.

    On the sphere itself all rotations look alike; the hollows beyond it (fossa, notch, rim) tell them apart, and what
    stands far in front of it is tissue. So any first points hold fixed shares of these strata, as far as they reach.
    """
    order = shuffled(len(points), seed)
    height = (np.linalg.norm(points - centre, axis=1) - radius_mm)[order]
    stratum = (height[:, None] < np.array(settings.stratum_heights_mm)).sum(axis=1)
    turn = np.empty(len(order))
    for index, share in enumerate(settings.stratum_shares):
        members = np.flatnonzero(stratum == index)
        turn[members] = (np.arange(len(members)) + 0.5) / share
    return order[np.argsort(turn, kind="stable")]


def survivors(stage: Stage, score: Float32Array) -> IntArray:
    """Which poses stay in a stage, best first, by the losses (K,) of all on its points."""
    order = np.argsort(score, kind="stable")
    close = int(np.searchsorted(score[order], score[order[0]] + stage.within))
    return order[: min(max(close, stage.min_survivors), stage.max_survivors)]


def successive_halving(
    view: View, cloud: Cloud, poses: Poses, stages: tuple[Stage, ...], stretch: float, settings: RobustSettings
) -> Poses:
    """Run the stages from `poses` and return those that survive them all, best first.

    Parameters
    ----------
    view : View
    cloud : Cloud
    poses : Poses
    stages : tuple of Stage
    stretch : float
        Factor on all scales of the loss, for noisier instruments.
    settings : RobustSettings
    """
    for number, stage in enumerate(stages):
        beams = cloud.beams.first(stage.points)
        field = view.fine if stage.fine else view.coarse
        if number > 0:
            ranking = OneSidedLoss(stage.scales_mm[0] * stretch, settings.search.ranking_inside)
            poses = poses.at(survivors(stage, scores(field, poses, beams, ranking, settings.step)))
        for scale in stage.scales_mm:
            poses = descended(field, poses, beams, OneSidedLoss(scale * stretch, stage.inside), settings.step)
    return poses


def distinct(poses: Poses, settings: SearchSettings) -> tuple[IntArray, IntArray]:
    """Indices of poses that are not one minimum with an earlier one, and how many fell to each."""
    chosen: list[int] = []
    hits: list[int] = []
    same_rad = np.radians(settings.same_deg)
    for index in range(len(poses)):
        relative = poses.rotations[chosen] @ poses.rotations[index].T
        cosine = (np.trace(relative, axis1=1, axis2=2) - 1.0) / 2.0
        near = np.arccos(np.clip(cosine, -1.0, 1.0)) < same_rad
        near &= np.linalg.norm(poses.shifts[chosen] - poses.shifts[index], axis=1) < settings.same_mm
        if near.any():
            hits[int(np.argmax(near))] += 1
        else:
            chosen.append(index)
            hits.append(1)
    return np.array(chosen, dtype=np.int64), np.array(hits, dtype=np.int64)
