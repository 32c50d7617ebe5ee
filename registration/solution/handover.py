"""What a method of registration hands over for assessment."""

from __future__ import annotations

from dataclasses import dataclass, field

from picoradar.registration._types import BoolArray, FloatArray, Neighbours
from picoradar.registration.model import Closest
from picoradar.registration.scan import NoiseModel
from picoradar.registration.solution.measures import Iteration


@dataclass(frozen=True)
class Rival:
    """Another pose that explains the points nearly as well.

    Attributes
    ----------
    model_from_scanner : (4, 4) array
    cost : float
        Mean robust cost a point, in the units of the solution's own `cost`.
    rotation_deg, translation_mm : float
        How far it is from the solution, the shift taken at the centre of the cloud.
    """

    model_from_scanner: FloatArray
    cost: float
    rotation_deg: float
    translation_mm: float


@dataclass(frozen=True)
class Alternative:
    """Where a walk along a weak mode came to rest: pose (4, 4), and its weight beside the best one's, which is 1."""

    model_from_scanner: FloatArray
    weight: float


@dataclass(frozen=True)
class Solution:
    """What a method hands over for assessment.

    Attributes
    ----------
    model_from_scanner : (4, 4) array
    closest : Closest
        Where the points lie on the model, with their residuals (N,).
    inliers : (N,) array of bool
        Points taken for bone.
    history : list of Iteration
    rivals : list of Rival
        Other minima, the likeliest first.
    noise : NoiseModel
    around : (N, 8) array
        Raster neighbours.
    cost : float
        Mean a point.
    method : str
    confident : bool
        The search reached this minimum often or clearly enough to trust that it missed no better one.
    alternatives : list of Alternative
        Ends of the walk along the weak mode, and poses that the beams hardly tell from this one.
    edges : bool
        Sharp edges may hold the pose: it was not found in a socket.
    beside_share : float
        Share of the points that lie just beside a closed model, where nothing sends light back.
    observed : (N,) array or None
        Weight of each point in the information observed [eq. 10], 1/mm^2; None: the inliers' own.
    """

    model_from_scanner: FloatArray
    closest: Closest
    inliers: BoolArray
    history: list[Iteration]
    rivals: list[Rival]
    noise: NoiseModel
    around: Neighbours
    cost: float
    method: str
    confident: bool = True
    alternatives: list[Alternative] = field(default_factory=list)
    edges: bool = False
    beside_share: float = 0.0
    observed: FloatArray | None = None
