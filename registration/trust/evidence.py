"""What a verdict is drawn from, and what the clinic asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from picoradar.registration.solution import Rival
from picoradar.registration.trust.covariance import Target


@dataclass(frozen=True)
class Tolerance:
    """What the clinic asks for (dissertation: 1 deg and 1 mm)."""

    rotation_deg: float = 1.0
    target_mm: float = 1.0


@dataclass(frozen=True)
class Objection:
    """What speaks against the points as a whole, and does not show in them: told by whoever measured them.

    Attributes
    ----------
    sentence : str
        What is wrong, and what to do.
    fails : bool
        Whether the pose must not be used; else the verdict is a caution at best.
    """

    sentence: str
    fails: bool = False


@dataclass(frozen=True)
class ShownError:
    """An error beyond its budget that the points show: name, size and SD in the budget's units, and the largest shift
    at a target by it, mm."""

    name: str
    value: float
    sd: float
    shift_mm: float


@dataclass(frozen=True)
class Evidence:
    """What the verdict is drawn from.

    Attributes
    ----------
    rotation_sd_deg : float
        Predicted, total over three axes.
    targets : list of Target
    points, inliers : int
    inside_share : float
        Share of points clearly inside bone, where no beam can end.
    beside_share : float
        Share of points just beside a closed model, whose beams pass it by.
    misfit_mm : float
        Departure of the model from the points that neighbours share.
    rivals : list of Rival
        Those that may be the truth.
    confident : bool
        The search reached this minimum often enough to trust that it missed no better one.
    range_error_known : bool
        How large a range error common to all points may be was measured.
    objections : sequence of Objection
        Of those who measured the points.
    beyond_probability : float
        Of a rotation beyond the tolerance, minima beside the pose that no fit reached included.
    shown : sequence of ShownError
        Errors beyond the budget that the points show.
    halves : float
        How far the poses of two halves of the points are apart, in shares of what noise allows in 95 % of all cases,
    halves_off : float
        and in shares of the tolerance.
    """

    rotation_sd_deg: float
    targets: list[Target]
    points: int
    inliers: int
    inside_share: float
    beside_share: float
    misfit_mm: float
    rivals: list[Rival]
    confident: bool
    range_error_known: bool
    objections: Sequence[Objection] = ()
    beyond_probability: float = 0.0
    shown: Sequence[ShownError] = ()
    halves: float = 0.0
    halves_off: float = 1.0
