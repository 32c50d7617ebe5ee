"""The curves of the dissertation's figures 4.3, 4.4, 4.10, 4.11, 4.24 and 4.25, drawn from our runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure


@dataclass
class Curves:
    """What the runs leave for the pictures.

    Attributes
    ----------
    runs : dict
        Residual rms (mm) at every iteration of the run from 15 deg, by model.
    noise : dict
        Rotation error (deg), shift (mm) and residual rms (mm) at every noise level (L, 3), by model.
    clinical, access : (L, 3) arrays
        Share, rotation error (deg), shift (mm).
    """

    runs: dict[str, list[float]] = field(default_factory=dict)
    noise: dict[str, np.ndarray] = field(default_factory=dict)
    clinical: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    access: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))


def draw_copies(curves: Curves, path: Path, noise_mm: Sequence[float]) -> None:
    """Convergence of the exact copies, and errors of the noisy ones."""
    figure, (run, noise) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for name, rms in curves.runs.items():
        run.semilogy(np.arange(len(rms)), rms, label=name.partition(" ")[2])
    run.set(xlabel="iteration", ylabel="residual rms, mm", title="exact copy from 15 deg (figs. 4.3, 4.10)")
    run.legend()
    for name, levels in curves.noise.items():
        body = name.partition(" ")[2]
        (line,) = noise.plot(noise_mm, levels[:, 0], "-", label=f"{body}: rotation, deg")
        noise.plot(noise_mm, levels[:, 1], "--", color=line.get_color(), label=f"{body}: shift, mm")
    noise.plot([1.0, 1.0], [0.08, 0.046], "k^", label="dissertation, rotation")
    noise.plot([1.0, 1.0], [0.41, 0.49], "ks", mfc="none", label="dissertation, shift")
    noise.set(xlabel="noise, mm", ylabel="error", title="noise on the copy (figs. 4.4, 4.11)")
    noise.legend(fontsize=8)
    _save(figure, path)


def draw_scans(curves: Curves, path: Path) -> None:
    """Errors under clinical noise, and with the rim cut away."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for axis, table, title, (share, rotation, shift) in (
        (axes[0], curves.clinical, "5 mm noise on a share of the points (fig. 4.24)", (30, 0.03, 0.29)),
        (axes[1], curves.access, "rim cut away (fig. 4.25)", (70, 2.0, 8.0)),
    ):
        axis.semilogy(100 * table[:, 0], table[:, 1], "o-", label="rotation, deg")
        axis.semilogy(100 * table[:, 0], table[:, 2], "s--", label="shift, mm")
        axis.plot(share, rotation, "k^", label="dissertation, rotation")
        axis.plot(share, shift, "ks", mfc="none", label="dissertation, shift")
        axis.set(xlabel="share, %", ylabel="error", title=title)
        axis.legend(fontsize=8)
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
