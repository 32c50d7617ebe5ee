"""Settings of the fit away from sockets, where sharp edges may hold the pose."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class EdgeSettings:
    """How a pose that edges and sparse strips hold is found and put to the test.

    Chosen on scenes of ``benchmarks/registration/sharp_bodies.py``; measured there on others.
    """

    max_fits: int = 5
    """Candidates that are fitted at most, whatever their likelihoods: a few tenths of a millimetre beside a sharp
    minimum these are hundreds of nats behind."""

    drawn_points: int = 600
    """Points that draw a candidate into its minimum."""

    loss_scales_mm: tuple[float, ...] = (4.0, 2.0, 1.0, 0.5, 0.25)
    """Widths of the loss that draws it [eq. 13]: from how far a search can miss down to the noise of a range."""

    steps_a_scale: int = 4
    """Steps at each width."""

    min_cosine: float = -0.1
    """Smallest cosine between beam and normal of a closest point: below it the surface faces away."""

    swapped_faces: int = 3
    """Faces of which two may change places, those with the most points: so many of a convex body are seen well."""

    same_normal: float = 0.01
    """Normals whose components round to the same multiples of this belong to one face: within 0.6 deg."""

    parallel_sine: float = 0.05
    """Smallest sine of the angle between two faces that meet in an edge: 3 deg."""

    max_halvings: int = 6
    """A step of the beam fit is halved so often at most: a sixty-fourth of it is less than the points' noise."""

    probe_rad: float = math.radians(1.5)
    """Farthest turn at which the information is put to the test [eq. 14]: about the tolerance of the clinic."""

    probe_mm: float = 1.0
    """The same for the points' shift (root mean square)."""

    probed_motions: int = 3
    """Motions that are tried: a plane, the least that is seen, holds the other three."""

    probe_shares: tuple[float, ...] = (-1.0, -2.0 / 3.0, -1.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
    """Where along each of them, as shares of the farthest."""

    max_leverage: float = 3.0
    """Points with more than so many times the mean leverage are the few that may hold a motion by mistake."""

    min_fall_share: float = 0.25
    """A log likelihood that falls by less than this share of the prediction does not bear the information out."""

    beside_mm: float = 5.0
    """Points this near to a closed model whose beams pass it by cannot have been measured from this pose."""
