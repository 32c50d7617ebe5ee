"""Pictures of the residuals: how they are spread, and how they shrank from iteration to iteration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.report.style import ACCENT, CLASSES, INK, LIMITS_MM, SECOND, classes_of, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from picoradar.registration.solution import Iteration

_LINEAR_SPAN = 20.0  # largest over smallest residual that a linear axis still shows well


def draw_histogram(residuals_mm: NDArray[np.float64]) -> Figure:
    """Draw the histogram of signed residuals (N,), with the limits of 1 and 3 mm."""
    figure = new_figure(9.0, 3.6)
    axes = figure.subplots()
    tidy(axes, "", "signed distance to the model, mm (positive: outside bone)", "points")
    widest = float(np.clip(np.abs(residuals_mm).max(initial=0.0) * 1.05, 1.5, 6.0))
    step = 0.05 if widest < 2.0 else 0.1
    ends = int(np.ceil(widest / step))
    edges = step * np.arange(-ends, ends + 1)
    shown = np.clip(residuals_mm, edges[0], edges[-1])
    kinds = classes_of(residuals_mm)
    for kind, entry in enumerate(CLASSES):
        counts, _ = np.histogram(shown[kinds == kind], edges)
        words = f"{entry.words}: {int((kinds == kind).sum())}"
        axes.bar(edges[:-1], counts, step, align="edge", color=entry.colour, linewidth=0, label=words)
    top = axes.get_ylim()[1]
    for limit in (value for value in LIMITS_MM if value < widest):
        for side in (-limit, limit):
            axes.axvline(side, color=INK, linewidth=1.0, linestyle="--")
        axes.text(limit, top, f" {limit:g} mm", color=INK, va="top")
    beyond = int((np.abs(residuals_mm) > edges[-1]).sum())
    if beyond:
        axes.text(0.99, 0.8, f"{beyond} points lie beyond the ends", transform=axes.transAxes, ha="right", color=INK)
    figure.legend(loc="outside lower center", ncols=len(CLASSES), frameon=False)
    axes.set_xlim(edges[0], edges[-1])
    return figure


def draw_convergence(history: Sequence[Iteration]) -> Figure:
    """Draw rms and largest residual against the iteration; the stages of the method are named."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    figure = new_figure(9.0, 3.6)
    axes = figure.subplots()
    tidy(axes, "", "iteration", "residual, mm")
    steps = np.arange(1, len(history) + 1)
    marker = "." if len(history) < 80 else ""
    largest = [entry.max_mm for entry in history]
    axes.plot(steps, largest, color=SECOND, marker=marker, linestyle="--", label="largest")
    axes.plot(steps, [entry.rms_mm for entry in history], color=ACCENT, marker=marker, label="root mean square")
    if max(largest) > _LINEAR_SPAN * min(entry.rms_mm for entry in history) > 0:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(0.0, 1.1 * max(largest))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    names = [entry.stage for entry in history]
    begins = [k for k in range(len(names)) if k == 0 or names[k] != names[k - 1]]
    if 1 < len(begins) <= 8:
        for k in begins:
            axes.axvline(k + 0.5, color="#9aa5b1", linewidth=0.8)
            axes.text(k + 0.6, 1.01, names[k], transform=axes.get_xaxis_transform(), color=INK, fontsize=8, ha="left")
    axes.legend(frameon=False)
    return figure
