"""Settings of the judgement, where they are not the clinic's tolerance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrustSettings:
    """What evidence makes a verdict a caution or a fail."""

    plausible_nats: float = 20.0
    """Total log likelihood below the best within which a rival may be the truth: neighbours are not independent."""

    patch_points: int = 8
    """Neighbours that share a departure of the model from the points [eq. 10]: the eight about a place."""

    patch_min_neighbours: int = 3
    """A point with fewer inliers beside it tells nothing of a shared departure."""

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
