"""Pictures of `scanner`, and the steps, times and limits that they show."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.settings import ScannerSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

STEP_MM, FLYBACK_MM = 1.0, 40.0
WAITS_MS = (0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 18.0, 25.0, 40.0)
STEP_LIMIT_MM, FLYBACK_LIMIT_MM = 0.10, 0.50  # what the dissertation measured at 1 m
LAG_MM = 0.03  # of the beam behind its place that a settling time may leave

PLACES = "Seen less asked place on the scale; the dashed lines are what the dissertation found at 1 m."
SETTLING = (
    "Mean way that is still missing, against the time since the command, with two standard errors. Dashed: waiting "
    "times in force."
)


def draw_positions(figure: Figure, asked: FloatArray, error: FloatArray) -> None:
    """Draw the error of each place against the place asked for (N,), mm."""
    axes = figure.subplots()
    axes.plot(asked, error, "o-", ms=4, lw=0.8)
    for limit in (-STEP_LIMIT_MM, STEP_LIMIT_MM):
        axes.axhline(limit, color="0.4", ls="--", lw=1)
    axes.set(xlabel="commanded place, mm", ylabel="error of the place, mm")
    axes.grid(alpha=0.3)


def draw_settling(figure: Figure, lags: dict[str, FloatArray], scanner: ScannerSettings) -> None:
    """Draw the mean way still missing (waits, repeats) against the time since the command."""
    axes = figure.subplots()
    ways = (
        ("step", f"{STEP_MM:g} mm step", scanner.settle_ms),
        ("flyback", f"{FLYBACK_MM:g} mm fly-back", scanner.flyback_settle_ms),
    )
    for number, (name, label, wait_ms) in enumerate(ways):
        table = lags[name]
        two_errors = 2 * table.std(axis=1, ddof=1) / math.sqrt(table.shape[1])
        axes.errorbar(WAITS_MS, table.mean(axis=1), two_errors, fmt="o-", ms=4, lw=0.8, label=label)
        axes.axvline(wait_ms, color=f"C{number}", ls="--", lw=1)
    axes.axhspan(-LAG_MM, LAG_MM, color="0.9")
    axes.set(xscale="log", xlabel="time after the command, ms", ylabel="way still missing, mm", ylim=(-0.2, 1.0))
    axes.set_xticks(WAITS_MS, [f"{wait:g}" for wait in WAITS_MS])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
