"""Picture of the places where two echoes were told apart: how far apart, and how bright each was."""

from __future__ import annotations

from typing import TYPE_CHECKING

from picoradar.instrument.recording import Cloud
from picoradar.instrument.report.style import ACCENT, INK, SECOND, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PALE = "#9aa5b1"


def draw_two_echoes(cloud: Cloud) -> Figure:
    """Draw where the two echoes are, coloured by their separation, and the amplitudes of both over it.

    Parameters
    ----------
    cloud : Cloud
        With at least one place that has two echoes.
    """
    figure = new_figure(9.6, 4.3)
    found = cloud.with_range()
    two, one = found.where(found.two_echoes), found.where(~found.two_echoes)
    apart_mm = two.last_range_mm - two.range_mm
    left, right = figure.subplots(1, 2)
    tidy(left, "where, and how far apart", "x, mm (as seen from the scanner)", "y, mm")
    left.plot(*one.points_mm[:, :2].T, "s", color=PALE, markersize=2, label=f"one echo: {len(one)}")
    x, y, _ = two.points_mm.T
    drawn = left.scatter(x, y, c=apart_mm, s=16, cmap="viridis", label=f"two echoes: {len(two)}", zorder=3)
    left.set_aspect("equal", adjustable="datalim")
    left.invert_xaxis()  # x points to the left of somebody who looks along +z with y up
    figure.colorbar(drawn, ax=left, shrink=0.85).set_label("last less first range, mm", color=INK)
    tidy(right, "how bright each is", "last less first range, mm", "amplitude of the echo, mV")
    right.plot(apart_mm, two.response_mv, "o", color=ACCENT, markersize=5, label="amplitude of the first")
    right.plot(apart_mm, two.last_response_mv, "^", color=SECOND, markersize=5, label="amplitude of the last")
    right.set_ylim(bottom=0)
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure
