"""Settings of the beam fit, of what lies beside a weakly held pose, and of the second fit without dark points."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BeamFitSettings:
    """The fit to cast beams [eq. 8, 9]."""

    max_casts: int = 6
    """Times at most that the beams are cast."""

    max_reweighted_steps: int = 5
    """Steps at most on fixed tangent planes, with weights and noise renewed before each."""

    settled_mm: float = 0.002
    """Weights have settled when a step moves the points by less (root mean square)."""

    resting_mm: float = 0.05
    """The fit ends when one cast has moved the points by less (root mean square): the tangent planes then hold."""

    prior_rad: float = 0.2
    """A priori standard deviation of a step's rotation: what the surface leaves free stays where it is."""

    prior_mm: float = 5.0
    """A priori standard deviation of a step's translation."""

    max_residual_sigma: float = 3.5
    """Residuals larger than this many sigma have no weight: 1 in 2000 of a Gaussian."""

    min_bone_probability: float = 0.5
    """A point counts as bone above this probability: the likelier of the two."""

    min_cosine: float = 0.05
    """Smallest cosine between beam and normal of a point that can have been seen: 87 deg."""

    stretch_min_cosine: float = 0.1
    """Smallest cosine that a residual along the beam is stretched by."""

    noise_min_cosine: float = 0.5
    """Points seen flatter than this say nothing of the range noise: noise across the beam adds to theirs."""


@dataclass(frozen=True)
class WeakModeSettings:
    """Other minima beside a pose whose rotation is held weakly [eq. 12]."""

    min_rotation_sd_deg: float = 0.3
    """Standard deviation of the rotation from which on they are looked for: of 1250 registrations below it one ended in
    such a minimum, of 860 above it 79."""

    walk_deg: tuple[float, ...] = (2.0, 4.0)
    """Turns from which the fit begins again, to either side: notches of a socket's likelihood lie so far apart."""

    walked_axes: int = 3
    """Axes of these turns, the worst held first: a clump of tissue may make a minimum about any."""

    same_sds: float = 3.0
    """Ends within so many standard deviations of the pose belong to its own minimum: 80 % of all six-fold motions."""

    min_points: int = 20
    """With fewer points there is no telling which motion is weak."""

    e_fold_nats: float = 10.0
    """An end whose log likelihood is so much lower counts for 1 / e: neighbours are not independent, and of wrong poses
    the truth was up to 20 nats less likely."""

    min_weight: float = 1e-3
    """Ends that count for less are left out."""


@dataclass(frozen=True)
class BrightnessSettings:
    """Points darker than bone, left out in a second fit."""

    min_share: float = 0.75
    """Share of the brightness of bone below which a point is none (soft tissue has about 0.75, blood 0.35)."""

    grazing_share: float = 0.3
    """Rough bone seen at grazing incidence keeps this share of its brightness (Oren and Nayar 1994)."""

    min_bright_inliers: float = 0.5
    """Were a smaller share of the inliers bright, the amplitudes would be no measure of the material: all stay."""

    search_points: int = 3000
    """Points that the search about the pose is made with; all take part in the last fit."""
