"""Pictures of `prism`: coloured maps, and histograms of the distances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from picoradar.instrument.procedures.prism.body import Distances, FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REACH_MM = 1.0


class _Evaluated(Protocol):
    @property
    def title(self) -> str: ...
    @property
    def points_mm(self) -> FloatArray: ...
    @property
    def distances(self) -> Distances: ...


def draw_map(figure: Figure, evaluations: Sequence[_Evaluated]) -> None:
    """Colour each point by its distance along the beam."""
    panels = figure.subplots(1, len(evaluations), sharex=True, sharey=True, squeeze=False)[0]
    for axes, evaluation in zip(panels, evaluations, strict=True):
        x, y, _ = evaluation.points_mm.T
        along = evaluation.distances.along
        dots = axes.scatter(x, y, c=along, s=3, cmap="RdBu_r", vmin=-REACH_MM, vmax=REACH_MM)
        beyond = np.abs(along) >= REACH_MM
        axes.scatter(x[beyond], y[beyond], s=22, facecolors="none", edgecolors="k", linewidths=0.7)
        axes.set(xlabel="X, mm", title=f"{evaluation.title}\n{beyond.sum()} beyond 1 mm", aspect="equal")
    panels[0].set_ylabel("Y, mm")
    figure.colorbar(dots, ax=panels, label="distance along the beam, mm", shrink=0.8)


def draw_distances(figure: Figure, evaluations: Sequence[_Evaluated]) -> None:
    """Draw the histograms of the three kinds of distance."""
    panels = figure.subplots(1, 3)
    kinds = ("along the beam", "perpendicular", "splatted surface")
    for number, (axes, kind) in enumerate(zip(panels, kinds, strict=True)):
        for evaluation in evaluations:
            values = np.abs(evaluation.distances[number])
            axes.hist(values, np.linspace(0, 2, 81).tolist(), histtype="step", label=evaluation.title)
        if kind == "along the beam":
            axes.axvline(1.0, color="0.4", ls="--", lw=1)
        axes.set(xlabel="distance, mm", title=kind, xlim=(0, 2))
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("points")
    panels[0].legend(frameon=False)
