"""Report of `penetration`: bias of each way of ranging, what is uncertain about it, and its pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from picoradar.instrument.calibration import Calibration, Material, Ranging, Stretch
from picoradar.instrument.procedures.penetration.step import Step
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLE_SD_LIMIT_MM = 0.25  # of the piece itself; 0.06 to 0.15 for one angle, and 4 % of the bias between the angles
COLUMNS = ("tilt_deg", "step_mm", "step_sd_mm", "bias_mm", "bare_points", "painted_points", "bare_mv", "painted_mv")


@dataclass(frozen=True)
class Piece:
    """What was measured on a half painted piece.

    Attributes
    ----------
    material : str
    coat_mm : float
        Thickness of the paint.
    poses : mapping
        Tilt (deg) to the step of each way of ranging.
    """

    material: str
    coat_mm: float
    poses: Mapping[float, Mapping[Ranging, Step]]

    def biases_mm(self, ranging: Ranging) -> list[float]:
        """Return the bias against paint at each tilt: the step less the paint that the beam crosses."""
        return [
            steps[ranging].step_mm - self.coat_mm / math.cos(math.radians(tilt)) for tilt, steps in self.poses.items()
        ]


def described(name: str, piece: Piece, after: Calibration, paint_bias_mm: float) -> Outcome:
    """Describe and judge what was measured."""
    entries = after.materials[piece.material]
    figures: dict[str, float | int | str | bool | None] = {"material": piece.material, "coat_mm": piece.coat_mm}
    for ranging, entry in entries.items():
        title = ranging.replace("-", "_")
        figures[f"{title}_bias_mm"] = entry.bias_mm
        figures[f"{title}_bias_of_surface_mm"] = entry.bias_mm + paint_bias_mm
        figures[f"{title}_sample_sd_mm"] = entry.sample_sd_mm
        figures[f"{title}_transfer_sd_mm"] = entry.transfer_sd_mm
        if entry.stretch is not None:
            figures[f"{title}_place_sd_mm"] = entry.stretch.place_sd_mm
        for tilt, bias in zip(piece.poses, piece.biases_mm(ranging), strict=True):
            figures[f"{title}_bias_at_{tilt:.0f}_deg_mm"] = bias
    worst = max(entries.values(), key=lambda entry: entry.sample_sd_mm)
    passed = worst.sample_sd_mm <= SAMPLE_SD_LIMIT_MM
    shown = entries.get("window", next(iter(entries.values())))
    stretch = shown.stretch
    figures["stretch_sd"] = None if stretch is None else stretch.sd
    plots = [Plot("bias", f"Range error on {piece.material}", _BIAS, lambda figure: _draw(figure, piece))]
    if stretch is not None:
        title = f"How {piece.material} stretches an echo"
        plots.append(Plot("stretch", title, _STRETCH, lambda figure: _draw_stretch(figure, stretch)))
    return Outcome(
        name,
        passed,
        _findings(piece.material, entries, shown, passed=passed),
        _next(piece.material, passed=passed),
        (
            f"{shown.bias_mm:.2f} ± {math.hypot(shown.sample_sd_mm, shown.transfer_sd_mm):.2f} mm",
            f"too far on another piece of {piece.material}, one standard deviation",
        ),
        figures,
        plots,
        {ranging: _readings(piece, ranging) for ranging in entries},
        after if passed else None,
    )


def _findings(material: str, entries: Mapping[Ranging, Material], shown: Material, *, passed: bool) -> list[str]:
    each = ", ".join(f"{entry.bias_mm:.2f} mm ({ranging})" for ranging, entry in entries.items())
    found = [
        f"This piece of {material} reads {each} farther than paint.",
        f"The piece itself is known to {shown.sample_sd_mm:.2f} mm; carried over to another piece, "
        f"{shown.transfer_sd_mm:.2f} mm come to that (standard deviations).",
    ]
    if abs(shown.bias_mm) < 2.0 * shown.sample_sd_mm:
        found.append(
            "No light was seen to enter it: nothing has to be taken off, and nothing is lost on another piece."
        )
    if shown.stretch is not None:
        found.append(
            f"It stretches its echoes, which is known to {shown.stretch.sd:.1%}: scans tell by theirs how far other "
            "pieces differ, and where there is paint."
        )
        found.append(
            f"From place to place it differs by {shown.stretch.place_sd_mm:.2f} mm (standard deviation): so uncertain "
            "is each point of a scan by itself."
        )
    if not passed:
        found.append(f"More than {SAMPLE_SD_LIMIT_MM:g} mm for the piece itself is too uncertain.")
    return found


def _next(material: str, *, passed: bool) -> str:
    if passed:
        return f"Use calibration.json of this folder (settings, key calibration), and scan with --material {material}."
    return "Take a larger and more even piece, with an opaque coat of even thickness, and run this again."


_BIAS = (
    "How much farther the bare half reads than paint, against the angle of incidence, with two standard errors; lines: "
    "what is taken off each range."
)


_STRETCH = (
    "What the fit of the pulse of paint leaves of the echoes of the bare half, in per cent of their amplitude, against "
    "the time after their 50 % point: a stretch of 1."
)


def _readings(piece: Piece, ranging: Ranging) -> Readings:
    rows = []
    for (tilt, steps), bias in zip(piece.poses.items(), piece.biases_mm(ranging), strict=True):
        step = steps[ranging]
        rows.append((tilt, step.step_mm, step.sd_mm, bias, step.bare, step.painted, step.bare_mv, step.painted_mv))
    return Readings(COLUMNS, np.array(rows, dtype=np.float64))


def _draw(figure: Figure, piece: Piece) -> None:
    axes = figure.subplots()
    tilts = list(piece.poses)
    for number, ranging in enumerate(next(iter(piece.poses.values()))):
        biases = piece.biases_mm(ranging)
        two_errors = [2 * steps[ranging].sd_mm for steps in piece.poses.values()]
        at = np.array(tilts) + (number - 1)  # beside each other
        axes.errorbar(at, biases, two_errors, fmt="o", ms=5, color=f"C{number}", label=ranging)
        axes.axhline(float(np.mean(biases)), color=f"C{number}", lw=1)
    axes.set(xlabel="angle of incidence, deg", ylabel="farther than paint, mm")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, loc="upper left")


def _draw_stretch(figure: Figure, stretch: Stretch) -> None:
    axes = figure.subplots()
    after_ps = stretch.start_ps + stretch.step_ps * np.arange(len(stretch.share))
    axes.plot(after_ps, 100.0 * np.array(stretch.share), lw=1.5)
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.set(xlabel="after the 50 % point, ps", ylabel="left by the fit, % of the amplitude")
    axes.grid(alpha=0.3)
