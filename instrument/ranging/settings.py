"""`RangingSettings`: what counts as a pulse, and what is held against one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RangingSettings:
    """Limits of the search for pulses; the defaults fit the dissertation's receiver (rise 210 ps, FWHM 600 ps).

    Attributes
    ----------
    detection_sigmas : float
        A pulse must rise by this many standard deviations of the noise of the coarse trace; 6 gives less than one
        false pulse in a million traces.
    least_response_mv : float
        And by at least this (mV), so that a trace without noise needs no special rule.
    bin_ps : float
        Width of the bins of the coarse trace; a quarter of the rise time keeps the pulse's form.
    narrowest_ps, widest_ps : float
        Full widths at half maximum (ps) between which a pulse is one pulse. Narrower is a disturbance, wider is two
        pulses run into each other.
    ringing_ps, ringing_share : float
        For that long after a pulse's peak, whatever is below that share of it is its own ringing.
    low_response_mv : float
        Echoes below are flagged.
    worst_misfit_sigmas, worst_residual : float
        An echo whose fit leaves residuals so many standard deviations above what noise gives, and greater than this
        share of its amplitude, has not the form of one surface.
    clip_mv : (float, float)
        A mean outside is clipped. Codes 1 and 254 of the reference device: a mean beyond the last whole code
        must have an end code (0 or 255) in its sum.
    """

    detection_sigmas: float = 6.0
    least_response_mv: float = 2.0
    bin_ps: float = 50.0
    narrowest_ps: float = 300.0
    widest_ps: float = 750.0
    ringing_ps: float = 1200.0
    ringing_share: float = 0.15
    low_response_mv: float = 15.0
    worst_misfit_sigmas: float = 6.0
    worst_residual: float = 0.02
    clip_mv: tuple[float, float] = (-15.5, 111.0)
