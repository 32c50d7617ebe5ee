"""How every picture looks: colours, residual classes, and a figure without any global state of matplotlib."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#1f2933"
GRID = "#dde3e9"
BONE = (0.87, 0.86, 0.83)
ACCENT = "#0b5cad"
SECOND = "#b3540a"
_DPI = 140


@dataclass(frozen=True)
class ResidualClass:
    """A class of residuals; shape and size tell it apart where colours are not seen."""

    words: str
    colour: str
    corners: int
    size: float
    marker: str


CLASSES = (
    ResidualClass("under 1 mm", "#1f5fbf", 4, 1.2, "s"),
    ResidualClass("1 to 3 mm", "#35a852", 5, 1.5, "p"),
    ResidualClass("over 3 mm", "#cc1f1a", 3, 2.0, "^"),
)
LIMITS_MM = (1.0, 3.0)
"""Limits of the dissertation's overlays (blue, green, red)."""


def classes_of(residuals_mm: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the (N,) class of each residual: 0 under 1 mm, 1 up to 3 mm, 2 above."""
    return np.digitize(np.abs(residuals_mm), LIMITS_MM, right=True).astype(np.int64)


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that draws with Agg alone."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def tidy(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    """Give axes the common look."""
    axes.set_title(title, color=INK, fontsize=11, loc="left")
    axes.set_xlabel(x_label, color=INK)
    axes.set_ylabel(y_label, color=INK)
    axes.tick_params(colors=INK)
    axes.grid(True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("#9aa5b1")


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG; the same figure gives the same bytes."""
    figure.savefig(path, dpi=_DPI, format="png", metadata={"Software": None})
    return path
