"""Every threshold of ranging in one place, with name, unit and source; what the planner of windows aims at is in
`picoradar.instrument.ranging.windows.PlanSettings`.

Where no source is named, `python benchmarks/ranging.py sensitivity` is the source: it halves and doubles each one, and
docs/ranging.md has its table. "Receiver" is the dissertation's: rise 210 ps, full width at half maximum 600 ps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from picoradar.instrument.ranging.scaling import OtherPulse, scaled
from picoradar.instrument.ranging.settings_of_means import AveragingSettings, WalkSettings
from picoradar.instrument.ranging.settings_of_noticing import NoticingSettings

__all__ = ["AveragingSettings", "LearningSettings", "NoticingSettings", "RangingSettings", "WalkSettings"]


@dataclass(frozen=True)
class RangingSettings(NoticingSettings):
    """Thresholds of `estimate`, `estimate_windows` and `estimate_points`; those of what fits leave are inherited.

    Attributes
    ----------
    min_samples, min_window_samples : int
        Fewer samples of a trace or window hold no pulse; three unknowns need a few samples on each side of an edge.
    fill_samples : int
        A trace whose end is NaN, because it is shorter than others, is filled with so many of its first samples, over
        and over; 0: a trace with NaN is not ranged.
    max_step_deviation : float
        By how much of its mean a sampling step may differ; rounding of instants to 0.001 ps stays far below.
    detection_sigmas : float
        A pulse must rise by this many standard deviations of the noise of the coarse trace; 6 gives less than one
        false pulse in a million traces (normal noise, 200 bins a trace).
    min_response_mv : float
        And by at least this (mV), so that a trace without noise needs no special rule: four codes of the A/D.
    bin_ps, min_bins : float, int
        Width of the bins of the coarse trace (ps); a quarter of the rise time keeps the pulse's form. A short trace
        still has so many bins.
    foot_bins, min_baseline_bins : int
        Bins before the first pulse that its foot may have reached, and how many more it takes to tell the baseline;
        with fewer it is the median of all bins.
    narrowest_ps, widest_ps : float
        Full widths at half maximum (ps) between which a pulse is one pulse: receiver, half and 1.25 times its own.
        Narrower is a disturbance, wider is two pulses run into each other.
    widest_reference_ps, edge_reach_ps : float
        A reference wider than the first (ps) has an echo in it; a leading edge is no longer than the second.
    ringing_ps, ringing_share : float
        For so long (ps) after a pulse's peak, whatever is below that share of it is its own ringing.
    touching_share : float
        Pulses overlap when the trace does not fall below that share of the second one between them.
    low_response_mv, low_response_sd_ps : float
        Echoes below (mV) are flagged: there the walk is several mm (dissertation, figure 2.15). And those whose instant
        has a greater standard deviation (ps): none here, where every range states its own.
    clip_mv : (float, float)
        A mean outside (mV) is clipped. Codes 1 and 254 of the reference device: a mean beyond the last whole code
        must have an end code (0 or 255) in its sum (protocol sheet ``sampling_bridge``).
    peak_half_width_ps, slope_half_width_ps : float
        Of the parabola through the peak, and of the cubic about the crossing, for the slope (ps); the slope of a line
        would be 3 % too small.
    crossing_half_width_ps : float
        Of the cubic (ps) whose crossing replaces that of the straight line between two samples; 0: the dissertation's
        straight line.
    piece_lead_ps, piece_trail_ps : float
        Piece about the 50 % point that is fitted (ps): from the foot to behind the fall.
    max_steps, settled_ps : int, float
        Gauss-Newton steps, and the length (ps) of one that ends them: it leaves an error of its square over the rise
        time, 0.04 ps.
    max_move_ps, min_growth : float
        Largest change of the delay (ps), and least ratio of the amplitudes, in one step: where there is no pulse.
    outlier_sigmas, max_outlier_share, max_outliers : float, float, int
        Samples so far off the fit are left out, if they are not more than that share of the piece, or that many; more
        are not misfired shots but another shape. 5.5: one good sample in 26 million. 0.25: of 8 sweeps, 2 % of lost
        shots make 15 % of bad samples.
    longest_outlier_run, longest_outlier_share : int, float
        Nor are more of them in a row than this many, or than this share of the piece.
    outlier_rounds, outlier_reach, min_usual_samples : int, int, int
        Fits without outliers; samples to either side whose median a sample is compared with; and samples whose median
        tells how far they usually lie off.
    worst_misfit_sigmas, worst_residual : float
        An echo whose fit leaves residuals so many standard deviations above what noise gives, and greater than this
        share of its amplitude, has not the form of one surface.
    prior_sd : float
        Knowledge before the fit, in ps and mV: nothing to a real pulse, but a piece without one stays solvable.
    phase_ps, rung, table_margin, table_reach_ps : float
        Look-up table of a pulse: spacing of its delays (ps), ratio of its neighbouring amplitudes, factor by which
        they go beyond those that were learnt, and extent to either side of the 50 % point (ps).
    min_shared, shared_scatter_sigmas : int, float
        References that are averaged at least, and by how many standard deviations the sum of their squared deviations
        may exceed its expectation.
    window_smooth_ps : float
        Over so much (ps) a window is smoothed to find its highest pulse: a quarter of the rise time, as `bin_ps`.
    window_foot_ps, window_top_ps : float
        Least way (ps) of the 50 % point from start and end of its window: foot and peak must be inside.
    start_height_mv : float
        Amplitude (mV) at which a fit starts where the window shows none.
    """

    min_samples: int = 64
    min_window_samples: int = 12
    fill_samples: int = 0
    max_step_deviation: float = 1e-3
    detection_sigmas: float = 6.0
    min_response_mv: float = 2.0
    bin_ps: float = 50.0
    min_bins: int = 8
    foot_bins: int = 2
    min_baseline_bins: int = 4
    narrowest_ps: float = 300.0
    widest_ps: float = 750.0
    widest_reference_ps: float = 750.0
    edge_reach_ps: float = 750.0
    ringing_ps: float = 1200.0
    ringing_share: float = 0.15
    touching_share: float = 0.075
    low_response_mv: float = 15.0
    low_response_sd_ps: float = math.inf
    clip_mv: tuple[float, float] = (-15.5, 111.0)
    peak_half_width_ps: float = 80.0
    crossing_half_width_ps: float = 0.0
    slope_half_width_ps: float = 80.0
    piece_lead_ps: float = 250.0
    piece_trail_ps: float = 900.0
    max_steps: int = 6
    settled_ps: float = 3.0
    max_move_ps: float = 60.0
    min_growth: float = 0.2
    outlier_sigmas: float = 5.5
    max_outlier_share: float = 0.25
    max_outliers: int = 2
    longest_outlier_run: int = 2
    longest_outlier_share: float = 0.05
    outlier_rounds: int = 5
    outlier_reach: int = 5
    min_usual_samples: int = 40
    worst_misfit_sigmas: float = 6.0
    worst_residual: float = 0.02
    prior_sd: float = 1e4
    phase_ps: float = 1.0
    rung: float = 1.15
    table_margin: float = 2.0
    table_reach_ps: float = 1500.0
    min_shared: int = 8
    shared_scatter_sigmas: float = 5.0
    window_smooth_ps: float = 60.0
    window_foot_ps: float = 80.0
    window_top_ps: float = 130.0
    start_height_mv: float = 1.0

    @classmethod
    def for_pulse(cls, pulse: OtherPulse) -> Self:
        """Scale every constant to the pulses of another instrument; `OtherPulse` has an example."""
        fwhm, step = pulse.fwhm_ps, pulse.step_ps
        return scaled(
            cls(),
            pulse,
            bin_ps=pulse.rise_ps_or_usual / 4,
            window_smooth_ps=pulse.rise_ps_or_usual / 4,
            min_samples=max(cls.min_window_samples, round(2 * fwhm / step)),
            widest_ps=1.4 * fwhm,  # slopes broaden an echo, and a bin is added to it
            widest_reference_ps=2.5 * fwhm,
            edge_reach_ps=4 * fwhm,
            piece_lead_ps=0.8 * fwhm,
            # The edge and the peak, and a sample behind it: the fall of echoes differs from slope to slope.
            piece_trail_ps=max(0.7 * fwhm, 3 * step),
            fill_samples=5,
            crossing_half_width_ps=0.4 * pulse.rise_ps_or_usual,
            low_response_sd_ps=0.15 * step,  # 0.6 of a step is then four of them
            table_reach_ps=2 * fwhm + 2 * step,
            max_outliers=0,  # of some ten samples in a piece none can be spared
            clip_mv=(pulse.full_scale[0] + pulse.code / 2, pulse.full_scale[1] - pulse.code / 2),
        )


@dataclass(frozen=True)
class LearningSettings:
    """Thresholds of `learn`, and of the shapes that `estimate` learns from the records themselves.

    Attributes
    ----------
    from_ps, to_ps : float
        Extent of the shapes about the 50 % point (ps): receiver, from before the foot to behind the ringing.
    smooth_ps, smooth_degree, min_smooth_samples : float, int, int
        Smoothing polynomial (Savitzky and Golay): degree 4 over half the rise time (ps) keeps the pulse's form; over
        fewer samples it would go through all of them.
    min_records : int
        Of a level.
    min_level_ratio : float
        By how much two levels' responses must differ, as a share.
    noise_rounds : int
        Weighted fits of the noise model; the weights settle in two.
    min_floor_mv, min_variance_mv2 : float
        Of traces without any noise: weights must stay finite.
    decimals : int
        Kept of a shape: 1e-5 of the peak is below any noise.
    max_records, coarsest_ps : int, float
        Records that shapes are learnt from without a calibration, and the coarsest step (ps) for it: a quarter of
        the rise time.
    rung_log : float
        Responses within a quarter share one shape (difference of logarithms).
    peak_room_ps, shape_step_ps : float
        Least extent (ps) of a shape behind its 50 % point, and longest step (ps) of a shape: records with longer ones
        are interpolated.
    fine_ps : float
        Step (ps) in which the peak and half height of a mean shape are looked for; its square is far below 1 ps.
    """

    from_ps: float = -500.0
    to_ps: float = 1500.0
    smooth_ps: float = 100.0
    smooth_degree: int = 4
    min_smooth_samples: int = 7
    min_records: int = 20
    min_level_ratio: float = 0.02
    noise_rounds: int = 3
    min_floor_mv: float = 1e-3
    min_variance_mv2: float = 1e-12
    decimals: int = 5
    max_records: int = 256
    coarsest_ps: float = 50.0
    rung_log: float = 0.25
    fine_ps: float = 0.25
    peak_room_ps: float = 400.0
    shape_step_ps: float = 50.0

    @classmethod
    def for_pulse(cls, pulse: OtherPulse) -> Self:
        """Scale every constant to the pulses of another instrument; `OtherPulse` has an example."""
        rise = pulse.rise_ps_or_usual
        return scaled(
            cls(),
            pulse,
            smooth_ps=rise / 2,
            coarsest_ps=pulse.fwhm_ps / 2,  # the records' different places between two samples show the rest
            from_ps=-1.2 * pulse.fwhm_ps,
            shape_step_ps=cls.shape_step_ps,  # the calibration file's limit
        )
