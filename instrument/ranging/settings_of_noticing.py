"""Thresholds of what the residuals of a fit say: more noise, another shape, a second pulse."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NoticingSettings:
    """Thresholds of `noticing.notice` and of the fit of two pulses.

    Attributes
    ----------
    max_pooled_misfit, slow_waves, least_expected, component_sigmas : float, int, float, float
        Of the noise that residuals show (`residual_noise`): records with more than so many times the usual sum of
        squares do not count; polynomials that see slow noise; least expected square of a deviation; and standard
        deviations that a component must stand out by.
    min_common, common_sigmas : int, float
        Records whose common residual is looked at (`common_shape`), and standard deviations by which it must stand out.
    common_local_ps, common_smoother, common_share : float, float, float
        Length (ps) over which the size of a change of shape is local; how much smoother the whole is than what a fit
        leaves of it; and share of the stated deviation from which on it is `distorted`.
    probes_ps, near_probes, probe_grid_ps : (floats), int, float
        A second pulse (`second_pulse`) is looked for at these distances (ps); so many of them are too near to be told
        apart; pulses are placed on a grid of so much (ps).
    near_sigmas, far_sigmas, explained_share : float, float, float
        It is believed from so many standard deviations on, if it explains so much of what is unusual; two pulses are
        fitted then. 2.7: 4 of 1000 single echoes are called mixed.
    start_offsets_ps, start_apart_ps, two_pulse_steps, apart_sigmas : (floats), float, int, float
        Places about the single pulse (ps) where two are looked for, least distance (ps) of the two, Gauss-Newton steps
        of their fit, and standard deviations by which they must lie apart to be two ranges.
    two_lead_ps, two_trail_ps, least_apart_ps : float, float, float
        Piece about the single pulse in which two are fitted (ps), and least distance (ps) of two ranges: light that
        enters tissue broadens an echo like two surfaces that are nearer.
    many_outliers, worst_energy_share : float, float
        A pulse with more than that share of its samples left out, or whose shots scatter by more in energy (the diode
        misfires), is `distorted`.
    stretch_neighbours, largest_stretch : int, float
        Of light that enters the target (`stretch`): records on either side whose median is what an echo is taken to be
        stretched by before it is judged, and the most of it. Fat is stretched 1.9 times as much as bone.
    """

    max_pooled_misfit: float = 3.0
    slow_waves: int = 4
    least_expected: float = 0.05
    component_sigmas: float = 3.0
    min_common: int = 8
    common_sigmas: float = 6.0
    common_local_ps: float = 150.0
    common_smoother: float = 1.5
    common_share: float = 0.6
    probes_ps: tuple[float, ...] = (67.0, 133.0, 267.0, 534.0)
    near_probes: int = 1
    probe_grid_ps: float = 10.0
    near_sigmas: float = 2.7
    far_sigmas: float = 4.0
    explained_share: float = 0.5
    start_offsets_ps: tuple[float, ...] = (40.0, 80.0, 130.0, 200.0, 300.0, 420.0, 560.0, 700.0, 850.0)
    start_apart_ps: float = 60.0
    two_pulse_steps: int = 10
    apart_sigmas: float = 4.0
    two_lead_ps: float = 500.0
    two_trail_ps: float = 1900.0
    least_apart_ps: float = 80.0
    many_outliers: float = 0.05
    worst_energy_share: float = 0.05
    stretch_neighbours: int = 5
    largest_stretch: float = 2.5
