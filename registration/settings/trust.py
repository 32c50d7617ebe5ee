"""Settings of the judgement, where they are not the clinic's tolerance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrustSettings:
    """What evidence makes a verdict a caution or a fail."""

    plausible_nats: float = 20.0
    """Total log likelihood below the best within which a rival may be the truth: neighbours are not independent."""

    patch_min_neighbours: int = 3
    """A point with fewer inliers beside it tells nothing of a shared departure."""

    patch_mm: float = 8.0
    """Length over which residuals are looked at for what patches share [eq. 10]: a film, a wave of a segmentation."""

    incidence_classes: int = 4
    """Classes of incidence in which the noise is measured: it may grow where beams graze."""

    min_class_points: int = 30
    """Points of such a class at least: with fewer a variance is uncertain by a quarter and more."""

    beyond_chance_sds: float = 3.0
    """What residuals show beyond the noise reckoned with counts from so many of its standard deviations on: 1 in 700
    by chance."""

    unseen_deg: float = 4.5
    """Standard deviation of the rotation at which, with as much tissue as bone, a minimum that was not found is as
    likely as not [eq. 16]."""

    unseen_sds: float = 8.0
    """How far such a minimum lies from the pose, in its standard deviations: the median of wrong poses was 6 to 10."""

    max_beyond: float = 0.014
    """Probability of a rotation beyond the tolerance from which on the verdict is a caution: of all that pass, few come
    near it, and one in 2000 may be wrong."""

    max_halves: float = 2.0
    """How far the poses of two halves may be apart, in shares of what noise allows in 95 % of all cases."""

    max_halves_off: float = 0.5
    """How far they may be apart in any case, as a share of the tolerance: half a scan is uncertain, and of a dense one
    any difference is beyond chance."""

    shown_sds: float = 4.0
    """An error beyond its budget counts as shown by the points from so many standard deviations on."""

    shown_share: float = 0.2
    """Shift that it causes at a target, as a share of the tolerance, from which on the verdict is a caution."""

    refit_mm: float = 0.05
    """What the points show of the budget's errors is taken off them, and the pose fitted again, where it changes the
    residuals by more than this (root mean square): a shift of the points changes which of them are taken for bone."""

    max_refits: int = 3
    """Times that this is done at most."""

    free_mm: float = 1e3
    """Standard deviation given to a motion that nothing holds [eq. 10]."""

    free_rotation_deg: float = 90.0
    """A predicted rotation beyond this means that nothing holds it."""

    free_target_mm: float = 100.0
    """A predicted error at a target beyond this means that nothing holds it."""

    rotation_sds: float = 2.0
    """Standard deviations of the rotation that stand for 95 % of all errors: 1.96 for one axis, rounded up."""

    bias_sds: float = 2.0
    """Standard deviations of the common range error that stand for 95 % of all cases, as for the rotation."""

    fail_factor: float = 2.0
    """Predicted errors beyond so many tolerances fail; between one and this they are a caution."""

    min_inlier_share: float = 0.25
    """With a smaller share of the points on the model there is no registration."""

    inside_sigmas: float = 4.0
    """A point lies inside bone when it does so by this many standard deviations: 3 in 100 000 by chance."""

    inside_min_sigma_mm: float = 0.25
    """Smallest standard deviation for that judgement: models err, too."""

    inside_caution_share: float = 0.005
    """Share of points inside bone that makes a caution."""

    inside_fail_share: float = 0.03
    """Share of points inside bone that fails."""

    beside_caution_share: float = 0.005
    """Share of points just beside a closed model that makes a caution.

    Of bodies with edges, right poses have at most 0.0015, most wrong ones 0.004 and more.
    """

    misfit_caution_share: float = 0.15
    """Departure of whole patches that makes a caution, as a share of the tolerance at the targets.

    Of 800 right registrations of simulated scans none reached 0.08 mm.
    """

    misfit_fail_share: float = 0.5
    """The same for a fail."""
