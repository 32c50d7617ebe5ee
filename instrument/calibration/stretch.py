"""`Stretch`: how light that enters a material changes the form of its echo, and what that tells about its delay.

Light that has wandered inside comes back late, and not all at once: the echo is stretched. Responses of one form that
are scaled in time by tau shift an echo by tau and stretch it by tau^2, to lowest order; of so much is what the fit of
the unstretched pulse leaves. So the size of what is left tells the bias: as its square root for little light, and a
bit slower for more (docs/range-error.md).
"""

from __future__ import annotations

import math

from pydantic import Field

from picoradar.instrument.calibration.parts import Part

POWER, POWER_SD = 0.45, 0.05
"""The bias goes as this power of the stretch: light of Monte-Carlo tables in six tissues (12 pieces each) gives 0.42 to
0.48, responses of one form 0.5 to lowest order; so 0.05 is its deviation (docs/range-error.md)."""

LAW_SHARE = 0.03
"""Deviation of the bias of two pieces of one material of the same stretch: the square root of two times 2 %, of 12
pieces of bone in the same tables."""


class Stretch(Part):
    """What the fit of the calibration's pulse leaves of the echo of one material, more than of that of paint.

    Attributes
    ----------
    start_ps, step_ps : float
        Times after the 50 % point of the pulse: of the first value, and from value to value.
    share : tuple of floats
        Of the amplitude, as the fit of a whole pulse leaves it. A stretch of 1 is this much, 0 is paint.
    sd : float
        Standard deviation of that 1 for the piece that was measured.
    place_sd_mm : float
        Standard deviation of the bias from place to place of the piece, mm; 0 in older files, which do not know it.
    """

    start_ps: float = Field(ge=-5000, le=5000, description="first time after the 50 % point, ps")
    step_ps: float = Field(gt=0, le=1000, description="from value to value, ps")
    share: tuple[float, ...] = Field(min_length=2, max_length=2000, description="what is left, share of the amplitude")
    sd: float = Field(ge=0, le=1, description="relative standard deviation of its size for the piece measured")
    place_sd_mm: float = Field(0.0, ge=0, le=50, description="by how much the bias differs from place to place, mm")


def stretch_terms(bias_mm: float, transfer_sd_mm: float, rest_mm: float, stretch: Stretch) -> dict[str, float]:
    """Return what a scan needs to correct its ranges by their stretch, as plain numbers (`line.unstretched`).

    Parameters
    ----------
    bias_mm, transfer_sd_mm : float
        Of the material.
    rest_mm : float
        Standard deviation of the common range error without what carrying the bias over adds.
    stretch : Stretch
    """
    return {
        "bias_mm": bias_mm,
        "rest_mm": math.hypot(rest_mm, POWER * bias_mm * stretch.sd),
        "piece_sd": transfer_sd_mm / (POWER * bias_mm),
        "power": POWER,
        "power_sd": POWER_SD,
        "law_sd": LAW_SHARE,
        "place_sd_mm": stretch.place_sd_mm,
    }
