"""Settings of the global search: steps on distance fields, and the stages of successive halving."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class StepSettings:
    """Damped Gauss-Newton steps on a distance field [eq. 9]."""

    stretch_min_cosine: float = 0.25
    """Smallest cosine between beam and normal that a residual along the beam [eq. 1] is stretched by."""

    facing_away_cosine: float = -0.5
    """Cosine below which a surface faces away; on edges a field's normal may lean to either side."""

    max_cast_mm: float = 4.0
    """Farthest that a beam is followed on a field."""

    ridge_per_rad2: float = 0.04
    """Stiffness a point that holds rotations which the surface leaves free; too small to slow others."""

    ridge_per_mm2: float = 1e-4
    """The same for translations."""

    damping: float = 1e-3
    """Levenberg-Marquardt damping of the search's steps, relative to the diagonal of the normal matrix."""

    refine_damping: float = 1e-6
    """The same where candidates are refined: they are near their minimum."""

    max_turn_rad: float = 0.2
    """Largest rotation of one step: beyond it the linearisation [eq. 2] no longer holds."""


@dataclass(frozen=True)
class Stage:
    """One stage of successive halving."""

    points: int
    """Points that take part."""

    fine: bool
    """Which field is read."""

    min_survivors: int
    """Poses that stay, the best on this stage's points, however far behind they are."""

    max_survivors: int
    """Poses that stay at most. The first stage takes all."""

    within: float
    """Beyond the `min_survivors`, only those stay whose loss a point is within this of the best one's."""

    scales_mm: tuple[float, ...]
    """Scale of the loss [eq. 5] in each step; the first one also serves to rank."""

    inside: float = 25.0
    """Largest loss inside bone, in units of the largest one in front of it."""


STAGES = (
    Stage(160, False, 256, 256, math.inf, (1.4, 1.0)),
    Stage(200, False, 24, 96, 0.5, (1.0, 0.8, 0.7)),
    Stage(400, True, 12, 32, 0.4, (0.7, 0.7, 0.7)),
    Stage(800, True, 8, 12, 0.35, (0.7, 0.7, 0.7, 0.7)),
)
"""Margins: on simulated scans the start that wins is never more than 0.45, 0.32 and 0.28 behind as a stage begins."""

PATIENT_STAGES = (
    STAGES[0],
    replace(STAGES[1], max_survivors=256, within=math.inf),
    replace(STAGES[2], max_survivors=96, within=math.inf),
    replace(STAGES[3], max_survivors=36, within=math.inf),
)
"""Stages for scans that stay unclear: under much tissue the right start can fall far behind before it wins."""

NEAR_STAGES = (
    Stage(250, True, 128, 128, math.inf, (1.0, 0.8, 0.7)),
    Stage(400, True, 6, 24, 0.25, (0.7, 0.7, 0.7)),
    Stage(800, True, 3, 8, 0.12, (0.7, 0.7, 0.7)),
)
"""Stages of a search about a minimum."""


PATCH_STAGES = (
    Stage(100, False, 7200, 7200, math.inf, (4.0, 3.0)),
    Stage(160, False, 512, 512, math.inf, (2.0, 1.4, 1.0)),
    Stage(200, True, 96, 192, 0.8, (1.0, 0.8, 0.7)),
    *PATIENT_STAGES[2:],
)
"""Stages of a search all over a body: starts are 10 mm and 15 deg off, so the first steps reach farther."""


@dataclass(frozen=True)
class SearchSettings:
    """The global search: how many starts, for how long, and when a minimum is believed."""

    starts: int = 256
    """Rotations that enter one round of successive halving (Jamieson and Talwalkar 2016)."""

    max_rounds: int = 4
    """Rounds at most while no confidence is reached."""

    patient_round: int = 2
    """Rounds from this one on leave more starts in: two have brought no confidence."""

    whole_min_rounds: int = 3
    """Rounds at least on a whole model: manufactured bodies are symmetric, and their rivals should be seen."""

    stages: tuple[Stage, ...] = STAGES
    patient_stages: tuple[Stage, ...] = PATIENT_STAGES
    near_stages: tuple[Stage, ...] = NEAR_STAGES

    ranking_inside: float = 5.0
    """Largest loss inside bone where poses are ranked, in units of the largest one in front of it [eq. 5]."""

    stratum_heights_mm: tuple[float, ...] = (1.0, -1.0, -2.5)
    """Heights over the sphere that part the points: hollows beyond it, the sphere itself, low tissue, high tissue."""

    stratum_shares: tuple[float, ...] = (0.4, 0.5, 0.1, 0.02)
    """How the points of a stage are drawn from these strata."""

    start_cone_deg: float = 25.0
    """How far clicked landmarks may be off."""

    start_reach_mm: float = 40.0
    """How far a start may be off in position."""

    min_covered_share: float = 0.6
    """A prepared view serves a start when it holds so many of the points, for a start may be off."""

    max_start_step_mm: float = 1.5
    """The prepared view of a whole model serves starts when its field is as fine as this."""

    start_margin_mm: float = 15.0
    """A view that is made for a start reaches so far beyond the points."""

    view_margin_deg: float = 5.0
    """Starts look into a hollow from its shell's cone, and from so much beyond it."""

    cone_margin_deg: float = 2.0
    """A pose found may lie so far outside the cone that was given."""

    other_radii: tuple[float, ...] = (0.96, 1.04)
    """Further radii of the socket's sphere, as shares of the model's, that are tried from the second round on."""

    other_radius_centres: int = 2
    """Centres tried of each of these."""

    alike_support: float = 0.85
    """Hollows are searched beside each other when their spheres hold more than this share of what the best one's holds:
    two hips differ by a few percent, a hollow of another radius holds less than half."""

    clear_nats: float = 40.0
    """A minimum is clear when its total log likelihood exceeds the next one's by so much."""

    poor_log_likelihood: float = -1.8
    """Mean log likelihood a point below which a minimum explains little: under 65 % of tissue it is as low."""

    poor_nats: float = 150.0
    """A minimum that explains little and lacks this margin may be of another place: under 70 % of tissue right ones
    exceed the next by 450 and more, wrong ones by 70 at most."""

    patch_places: int = 600
    """Places all over the body that the cloud's middle is laid on in one round."""

    patch_rolls: int = 12
    """Turns about the normal at each: 30 deg apart."""

    patch_mm: float = 8.0
    """Radius about the cloud's middle that tells its normal."""

    middle_share: float = 0.1
    """Share of the points, those nearest the cloud's mean, that are its middle."""

    middles: int = 20
    """Places in the middle whose flattest one is laid on the body: there the normal is best known."""

    patch_stages: tuple[Stage, ...] = PATCH_STAGES

    confident_hits: int = 3
    """A minimum that so many survivors of one round reach, or that wins two rounds, is trusted; so is a clear one."""

    well_met_hits: int = 4
    """A clear minimum that so many survivors reached needs no closer look."""

    clear_near_deg: float = 8.0
    """Half angle of the search about a minimum that is clear."""

    clear_near_starts: int = 32
    """Starts of it."""

    unclear_near_deg: float = 30.0
    """Half angle of the search about a minimum where others are nearly as good."""

    unclear_near_starts: int = 128
    """Starts of it."""

    same_deg: float = 2.0
    """Poses that differ by less than this, and by less than `same_mm`, are one minimum."""

    same_mm: float = 1.0
    """The same for the shift of the cloud's middle."""

    refined_points: int = 1500
    """Candidates are refined and compared on at most so many points; all take part in the beam fit."""

    max_refined: int = 4
    """Candidates of a round that are refined to the end."""

    coarse_steps: int = 5
    """Refining steps of all candidates, on closest points, which reach far."""

    fine_steps: int = 2
    """Further steps on closest points of those that are refined to the end."""

    cast_steps: int = 3
    """Their last steps, on beams cast on the field, which are exact."""
