"""Thresholds of what is made of many readings: the walk and averages; those of single ones are in `settings`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WalkSettings:
    """Thresholds and priors of `fit_walk`; priors as (lowest, highest, number of values).

    Attributes
    ----------
    min_levels, min_readings : int
        Gray levels, and usable readings in each.
    min_level_ratio : float
        By how much two levels' responses must differ, as a share.
    outlier_sigmas, min_deviation_mm : float
        Readings so many robust standard deviations off their level's median are left out; the median deviation
        counts as at least so much (mm), far below a reading's noise.
    rounds : int
        The slope of the first tells what a wrong response does to an error.
    knots : int
        Of the curve in the calibration file.
    drawn : int
        Curves drawn from the process; their standard deviation is known to 4 %.
    min_prior_weight : float
        A prior less likely than that share of the likeliest one is left out: it changes nothing.
    reference_mv : float
        Response (mV) at which the priors' scales hold.
    scales_mm, length_logs, powers : (float, float, int)
        Prior scales of the walk (mm), lengths of the kernel in ln(response), and powers of the response with which
        the walk dies out.
    """

    min_levels: int = 4
    min_readings: int = 10
    min_level_ratio: float = 1e-3
    outlier_sigmas: float = 5.0
    min_deviation_mm: float = 1e-9
    rounds: int = 2
    knots: int = 97
    drawn: int = 400
    min_prior_weight: float = 1e-3
    reference_mv: float = 15.0
    scales_mm: tuple[float, float, int] = (0.02, 60.0, 14)
    length_logs: tuple[float, float, int] = (0.2, 3.0, 10)
    powers: tuple[float, float, int] = (0.0, 6.0, 5)


@dataclass(frozen=True)
class AveragingSettings:
    """Thresholds of `average_sweeps` and `average_ranges`.

    Attributes
    ----------
    sweep_sigmas : float
        A sweep is left out when its mean square deviation exceeds the usual one by so many standard deviations of
        white noise: twice the 8 that would do, because noise is greater on the pulses, where fewer samples decide.
    outlier_sigmas : float
        A reading so far off the median is left out.
    min_to_judge : int
        Of two readings none can be judged.
    """

    sweep_sigmas: float = 16.0
    outlier_sigmas: float = 5.0
    min_to_judge: int = 3
