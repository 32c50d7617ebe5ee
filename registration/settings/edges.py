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
    """Steps at each width at most."""

    settled_share: float = 0.01
    """The next width follows when a step has changed no residual by more than this share of the width."""

    min_cosine: float = -0.1
    """Smallest cosine between beam and normal of a closest point: below it the surface faces away."""

    searched_planes: int = 12
    """Planes of the model, those of its largest triangles, that may be flat faces: twice as many as a box has."""

    flat_mm: float = 0.01
    """Height over a plane within which triangles belong to it: less than a mesh is true to its body."""

    min_face_share: float = 0.02
    """Least share of the model's area that a flat face has: of triangulated bone no plane reaches it."""

    min_corner_sine: float = 0.2
    """Least sine of the angle at a corner: 12 deg, six times the turn between facets of a usual cylinder."""

    max_corners: int = 8
    """Corners of a face at most: what has more is a ragged cut, and its corners are as many as they are wrong."""

    turned_poses: int = 3
    """The likeliest poses, from which the corners of faces are laid on each other: one of them has a corner right."""

    screened_points: int = 150
    """Points by which poses that bring corners together are compared before they are drawn: half of them from the face
    that most points lie on, half from elsewhere."""

    screening_mm: float = 2.0
    """Distance at which a point counts no further there: the widest strip of a neighbour that scans were made with."""

    drawn_corners: int = 8
    """The best of these poses, which are drawn into their minima."""

    corner_rounds: int = 2
    """Times that corners are brought together at most: a likelier pose has other rivals."""

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

    e_fold_nats: float = 5.0
    """A probed pose whose log likelihood is so much lower counts for 1 / e in the covariance."""

    beside_mm: float = 5.0
    """Points this near to a closed model whose beams pass it by cannot have been measured from this pose."""
