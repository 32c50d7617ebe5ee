"""Picture of one trace with its two time-significant points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging import SPEED_OF_LIGHT_MM_PER_PS, estimate
from picoradar.instrument.report.style import ACCENT, INK, SECOND, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]


def draw_waveform(times_ps: FloatArray, trace_mv: FloatArray, caption: str) -> Figure:
    """Draw a trace (S,) in mV over its times (S,) in ps."""
    figure = new_figure(9.0, 3.6)
    axes = figure.subplots()
    tidy(axes, caption, "time after the laser trigger, ns", "at the photodiode, mV")
    axes.plot(times_ps / 1000, trace_mv, color="#52606d", linewidth=1.0)
    points = time_significant_points(times_ps, trace_mv)
    top = float(trace_mv.max())
    for name, colour, (time_ps, level_mv) in zip(("reference", "echo"), (SECOND, ACCENT), points, strict=False):
        axes.axvline(time_ps / 1000, color=colour, linewidth=0.8, linestyle=":")
        words = f"{name}: 50 % of its peak at {time_ps / 1000:.3f} ns"
        axes.plot(time_ps / 1000, level_mv, "o", color=colour, markersize=7, zorder=3, label=words)
    if len(points) == 2:
        (start_ps, _), (end_ps, _) = points
        height = 1.1 * top
        arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (start_ps / 1000, height), (end_ps / 1000, height), arrowprops=arrow)
        middle = (start_ps + end_ps) / 2000
        axes.text(middle, 1.13 * top, f"Ti = {(end_ps - start_ps) / 1000:.3f} ns", ha="center", color=INK)
        axes.set_ylim(top=1.28 * top)
    if points:
        axes.legend(loc="upper right", framealpha=0.95, edgecolor="none")
    axes.set_xlim(times_ps[0] / 1000, times_ps[-1] / 1000)
    return figure


def time_significant_points(times_ps: FloatArray, trace_mv: FloatArray) -> list[tuple[float, float]]:
    """Return (time in ps, level in mV) of the time-significant points of reference and echo, as far as there are any.

    They come from the ranging itself, by half maximum (section 2.5); without calibration its range is c / 2 x Ti.
    """
    found = estimate(trace_mv[None, :], times_ps, method="half-maximum")
    interval_ps = 2 * found.range_mm[0] / SPEED_OF_LIGHT_MM_PER_PS
    times = [time for time in (found.reference_ps[0], found.reference_ps[0] + interval_ps) if np.isfinite(time)]
    return [(float(time), float(np.interp(time, times_ps, trace_mv))) for time in times]
