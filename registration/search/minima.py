"""Distinct minima of a search, and how lists of them are joined."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.model import View
from picoradar.registration.se3 import rotation_angle_deg, transform
from picoradar.registration.settings import SearchSettings


@dataclass(frozen=True)
class Candidate:
    """A distinct minimum.

    Attributes
    ----------
    model_from_scanner : (4, 4) array
    log_likelihood : float
        Mean a point; the larger the better.
    hits : int
        Survivors of successive halving that ended here.
    view : View
        That it was found in.
    """

    model_from_scanner: FloatArray
    log_likelihood: float
    hits: int
    view: View


def merged(
    one: list[Candidate], other: list[Candidate], at: FloatArray, settings: SearchSettings, *, bonus: int = 0
) -> list[Candidate]:
    """Join lists of minima, best first; a minimum found again keeps its better pose and gains `bonus` hits.

    Poses are compared by their rotations and by where the scanner-frame point `at` (3,) goes.
    """
    out: list[Candidate] = []
    for candidate in sorted([*one, *other], key=lambda c: -c.log_likelihood):
        for index, better in enumerate(out):
            if same_minimum(better.model_from_scanner, candidate.model_from_scanner, at, settings):
                out[index] = replace(better, hits=better.hits + candidate.hits + bonus)
                break
        else:
            out.append(candidate)
    return out


def same_minimum(one: FloatArray, other: FloatArray, at: FloatArray, settings: SearchSettings) -> bool:
    """Whether two poses (4, 4) are so near that they count as one minimum; the shift is that of the point `at`."""
    turn, shift = difference(one, other, at)
    return turn < settings.same_deg and shift < settings.same_mm


def difference(one: FloatArray, other: FloatArray, at: FloatArray) -> tuple[float, float]:
    """Rotation in degrees between two poses, and the shift in mm of the scanner-frame point `at`."""
    shift = transform(one, at[None])[0] - transform(other, at[None])[0]
    return rotation_angle_deg(one[:3, :3] @ other[:3, :3].T), float(np.linalg.norm(shift))
