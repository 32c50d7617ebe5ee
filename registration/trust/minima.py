"""Minima beside the pose that may be the truth: rivals, ends of fits, and those that were not found."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.refine import motion_between
from picoradar.registration.settings import RobustSettings, TrustSettings
from picoradar.registration.solution import Rival, Solution
from picoradar.registration.trust.fit import Assessed


def unseen_probability(fit: Assessed, settings: TrustSettings) -> float:
    """Probability of a minimum beside the pose that no fit reached [eq. 16]: it grows with the square of the rotation's
    spread, and with the share of tissue, whose clumps make such minima."""
    spread_deg = float(np.degrees(np.sqrt(max(0.0, np.trace(fit.own[:3, :3])))))
    bone = float(fit.used.mean())
    odds = (spread_deg / settings.unseen_deg) ** 2 * (1.0 - bone) / bone
    return odds / (1.0 + odds)


def plausible_rivals(solution: Solution, points: int, settings: TrustSettings) -> list[Rival]:
    """Rivals that may be the truth, by so many independent points."""
    return [r for r in solution.rivals if (r.cost - solution.cost) * points < settings.plausible_nats]


def rivals_as_ends(
    rivals: Sequence[Rival], solution: Solution, points: int, centre: FloatArray, settings: RobustSettings
) -> list[tuple[FloatArray, float]]:
    """Poses and weights [eq. 12] of rivals that are no end beside the pose already."""
    found, nats = [], settings.weak_mode.e_fold_nats
    for rival in rivals:
        apart = [
            motion_between(end.model_from_scanner, rival.model_from_scanner, centre) for end in solution.alternatives
        ]
        same = settings.search.same_mm, np.radians(settings.search.same_deg)
        if not any(np.linalg.norm(x[3:]) < same[0] and np.linalg.norm(x[:3]) < same[1] for x in apart):
            found.append((rival.model_from_scanner, math.exp(min(0.0, solution.cost - rival.cost) * points / nats)))
    return found


def minima_of(
    solution: Solution, fit: Assessed, ends: Sequence[tuple[FloatArray, float]]
) -> list[tuple[FloatArray, float]]:
    """Motions (6,) from the pose to other minima, with their weights."""
    return [(motion_between(solution.model_from_scanner, pose, fit.centre), weight) for pose, weight in ends]


def shift_at(motion: FloatArray, position: FloatArray, centre: FloatArray) -> FloatArray:
    """Shift (3,) of a target by a small motion (6,) about `centre` (3,)."""
    return np.asarray(motion[3:] + np.cross(motion[:3], position - centre), dtype=np.float64)
