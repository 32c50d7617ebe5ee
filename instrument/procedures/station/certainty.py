"""What noise allows a procedure to judge.

A verdict must not depend on the noise that a run happens to get. A mean that is judged as measured needs a standard
error small against its limit (`too_coarse`). The largest of several noisy figures is compared with what noise alone
would give, where that is more than the limit (`largest_by_noise`, `root_mean_square_by_noise`).
"""

from __future__ import annotations

import math
from statistics import NormalDist

CHANCE = 0.01  # that a run without a defect fails by noise, over all figures that one limit judges
STAGE_SD_MM = 0.05  # of a distance as the stage's scale reads it
ZERO_REPEAT_SD_MM = 0.1  # of a range zero from one day, distance and cabling to another: in the simulator's second
# world, pick-up in step with the trigger (0.1 mV) alone moves it by 0.0 to 0.23 mm from bench to bench
COARSE = 4.0  # least limit over standard error of a mean judged as measured: noise alone exceeds it 1 time in 16 000


def zero_sd_mm(measured_sd_mm: float) -> float:
    """Return the standard deviation of a range zero when it is used: that of its measurement, and its repeatability."""
    return math.hypot(measured_sd_mm, ZERO_REPEAT_SD_MM)


def largest_by_noise(count: int) -> float:
    """Return which deviation, in standard errors, the largest of ``count`` means exceeds by noise with `CHANCE`.

    Bonferroni's bound on two-sided Gaussian deviations, which need not be independent.
    """
    return NormalDist().inv_cdf(1.0 - CHANCE / (2.0 * max(count, 1)))


def root_mean_square_by_noise(count: int, fitted: int) -> float:
    """Return which root mean square of ``count`` unit residuals of a fit noise alone exceeds with `CHANCE`.

    Of chi-square with ``count - fitted`` degrees of freedom, by the cube of Wilson and Hilferty (Proc. Natl. Acad. Sci.
    USA 17 (1931) 684), which is right within 0.2 % here.
    """
    share = 2.0 / (9.0 * max(count - fitted, 1))
    return math.pow(1.0 - share + NormalDist().inv_cdf(1.0 - CHANCE) * math.sqrt(share), 1.5)


def too_coarse(what: str, standard_mm: float, limit_mm: float, *, least: float = COARSE) -> str:
    """Say that means are too uncertain to be judged by a limit; empty when they are not.

    Parameters
    ----------
    what : str
        What is judged.
    standard_mm : float
        Largest standard error of the means.
    limit_mm : float
        Of the means.
    least : float
        Limit over standard error that is enough.
    """
    if limit_mm >= least * standard_mm:  # a standard error of NaN, of fewer than two readings, is too uncertain as well
        return ""
    more = f"{(least * standard_mm / limit_mm) ** 2:.1f} times as many" if math.isfinite(standard_mm) else "more"
    return (
        f"The readings are too few to judge {what}: a mean is uncertain by {standard_mm:.3f} mm, and the limit is "
        f"{limit_mm:g} mm. Take {more}, or more averages."
    )
