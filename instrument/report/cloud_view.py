"""Picture of the point cloud as the scanner sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from picoradar.instrument.recording import Cloud
from picoradar.instrument.report.style import INK, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_cloud(cloud: Cloud) -> Figure:
    """Draw the cloud from the scanner, coloured by range and by response; points without a range as crosses."""
    figure = new_figure(9.6, 4.3)
    found = cloud.with_range()
    lost = cloud.where(~cloud.has_range)
    x, y, _ = found.points_mm.T
    size = float(np.clip(235 / np.sqrt(len(cloud)), 1.0, 12.0)) ** 2  # points^2: about the distance of two points
    pictures = (
        ("range along the beam", found.range_mm, "mm", "viridis_r"),
        ("response (amplitude of the echo)", found.response_mv, "mV", "cividis"),
    )
    for axes, (title, values, unit, colours) in zip(figure.subplots(1, 2), pictures, strict=True):
        tidy(axes, title, "x, mm (as seen from the scanner)", "y, mm")
        low, high = np.percentile(values, [1, 99]) if len(found) else (0.0, 1.0)
        drawn = axes.scatter(x, y, c=values, s=size, marker="s", cmap=colours, vmin=low, vmax=high, linewidths=0)
        if len(lost) and len(found):
            axes.plot(
                *_places_without_range(cloud).T, "x", color="#cc1f1a", markersize=4, label=f"no range: {len(lost)}"
            )
        axes.set_aspect("equal")
        axes.invert_xaxis()  # x points to the left of somebody who looks along +z with y up
        bar = figure.colorbar(drawn, ax=axes, shrink=0.85, extend="both")
        bar.set_label(unit, color=INK)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", frameon=False)
    return figure


def _places_without_range(cloud: Cloud) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return about where the (M, 2) beams without an echo went: angles times the mean range."""
    mean_range = float(np.mean(cloud.with_range().range_mm))
    return np.asarray(cloud.angles_rad[~cloud.has_range] * mean_range, dtype=np.float64)
