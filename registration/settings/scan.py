"""Settings of the measured side: the noise of a point, and bone or tissue."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NoiseSettings:
    """Noise of one measured point [eq. 6]."""

    typical_range_mm: float = 0.4
    """Range noise of a point averaged over 8 sweeps, assumed until the residuals tell."""

    min_range_mm: float = 0.02
    """Smallest range noise of any instrument that this is for; what is found below it is taken for it."""

    max_range_mm: float = 5.0
    """Largest range noise of any instrument that this is for."""

    lateral_mm: float = 0.04
    """Standard deviation across the beam, per axis: noise of the pointing."""

    model_mm: float = 0.03
    """Standard deviation of the model's surface along its normal: facets, segmentation."""

    min_residuals: int = 20
    """Fewer residuals cannot tell their scale."""

    raster_share: float = 0.65
    """Share of the raster's departures [eq. 7], an upper bound, that is taken for noise: shape departs, too."""

    raster_min_mm: float = 0.1
    """Smallest noise that the search takes from a raster."""

    raster_max_mm: float = 2.0
    """Largest noise that the search takes from a raster."""

    raster_min_neighbours: int = 6
    """A point with fewer of its eight neighbours tells no departure: it lies on an edge of the scan."""

    max_response_ratio: float = 4.0
    """Noise differs from that of the median echo by this factor at most: beyond it other errors rule."""


@dataclass(frozen=True)
class TissueSettings:
    """Mixture of bone and tissue along the beam [eq. 3], and how neighbours share what they know [eq. 4]."""

    density_per_mm: float = 0.1
    """Density of tissue heights: anything up to about a centimetre is equally likely."""

    onset_mm: float = 0.7
    """Height at which tissue is half as dense as above: thinner films pass for bone."""

    onset_width_mm: float = 0.2
    """Width of that onset, the scale of its logistic function."""

    stray_per_mm: float = 2e-3
    """Density of anything else: stray echoes, points inside bone."""

    coupling: float = 0.25
    """Share of a neighbour's log odds that a point takes over: one mean-field pass of a Markov random field."""

    max_neighbour_nats: float = 3.0
    """Largest log odds that a neighbour may put in."""

    independent_points: int = 1500
    """Points of a finer raster see the same clumps of tissue: evidence for a pose grows no further with them."""

    residual_inside_mm: float = 10.0
    """Residual inside bone that stands for a beam that cannot have been measured from this pose."""

    residual_outside_mm: float = 5.0
    """Residual in front of bone that stands for a beam that ends on what an open model lacks."""
