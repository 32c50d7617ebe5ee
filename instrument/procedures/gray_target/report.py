"""Report of `gray-target`: what the correction leaves on cards that it has not seen, and its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from picoradar.instrument.calibration import METHODS, Calibration
from picoradar.instrument.procedures.gray_target.level import FloatArray, Level
from picoradar.instrument.procedures.station.certainty import COARSE, largest_by_noise, too_coarse
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WEAK_MV, STRONG_MV, BRIGHT_MV = 15.0, 25.0, 65.0
BIAS_LIMIT_MM, WEAK_BIAS_LIMIT_MM = 0.05, 0.10
BANDS = {"25_to_65_mv": (STRONG_MV, BIAS_LIMIT_MM), "15_to_65_mv": (WEAK_MV, WEAK_BIAS_LIMIT_MM)}
NOISY = 1.0  # least limit over standard error of a half-maximum mean: its noise, not its limit, decides below that
COLOURS = ("tab:orange", "tab:blue", "tab:green", "tab:red")  # of the estimators, in their order
OF_LEVEL = ("response_mv", "error_before_mm", "error_after_mm", "single_reading_sd_mm", "standard_error_mm")
COLUMNS = (
    "reflectance",
    "held_back",
    *(f"{method.replace('-', '_')}_{what}" for method in METHODS for what in OF_LEVEL),
)


def judged(name: str, measured: Sequence[Level], after: Calibration, remedy: str) -> Outcome:
    """Judge a calibration on every second card, which it has not seen.

    The template estimator must keep the limits as measured. The half-maximum estimator is noisier by far than the
    limits: where that is more than a limit, its largest mean may be what noise of card and correction alone gives.
    """
    table = _table(measured, after)
    held = table[table[:, 1] == 1]
    figures: dict[str, float | int | str | bool | None] = {"range_zero_mm": after.range_zero_mm}
    broken: list[str] = []
    for number, method in enumerate(METHODS):
        response, before, error, single, standard = held[:, 2 + 5 * number : 7 + 5 * number].T
        both = np.hypot(standard, after.walk[method].at(response).sd_mm)
        title = method.replace("-", "_")
        for band, (least_mv, limit_mm) in BANDS.items():
            inside = (response >= least_mv) & (response <= BRIGHT_MV)
            figures[f"{title}_bias_{band}_mm"] = _largest(error[inside])
            figures[f"{title}_standard_error_{band}_mm"] = _largest(standard[inside])
            figures[f"{title}_single_reading_sd_{band}_mm"] = _largest(single[inside])
            figures[f"{title}_uncorrected_{band}_mm"] = _largest(before[inside])
            allowed = np.full(int(inside.sum()), limit_mm)
            if method != "template":
                allowed = np.maximum(limit_mm, largest_by_noise(allowed.size) * both[inside])
            least = COARSE if method == "template" else NOISY
            broken += _broken(method, band, np.abs(error[inside]), standard[inside], allowed, least=least)
    worst = figures["template_bias_15_to_65_mv_mm"]
    shown = "no card" if worst is None else f"{worst:.3f} mm"
    findings = [
        f"On {len(held)} cards that the calibration has not seen, the template estimator is wrong by at most {shown} "
        f"from {WEAK_MV:g} to {BRIGHT_MV:g} mV. Uncorrected, a card of 15 mV would come out several mm too far."
    ]
    findings += dict.fromkeys(broken)
    passed = not broken
    return Outcome(
        name,
        passed,
        findings,
        "Use calibration.json of this folder: settings, key calibration." if passed else remedy,
        (shown, "largest bias on cards held back, template estimator (at most 0.05 mm from 25 mV, 0.1 mm from 15 mV)"),
        figures,
        [
            Plot("walk", "Range error against response", _WALK, lambda figure: _draw_walk(figure, table, after)),
            Plot("after", "What is left after the correction", _AFTER, lambda figure: _draw_after(figure, table)),
        ],
        {"levels": Readings(COLUMNS, table)},
        after,
    )


def _broken(
    method: str, band: str, error_mm: FloatArray, standard_mm: FloatArray, allowed_mm: FloatArray, *, least: float
) -> list[str]:
    """Say why the means (mm) of the cards in a band do not pass: no card, too uncertain, or beyond what is allowed."""
    least_mv, limit_mm = BANDS[band]
    where = f"from {least_mv:g} to {BRIGHT_MV:g} mV"
    if not error_mm.size:
        return [f"No card held back lies {where}: take whiter cards or stand them elsewhere."]
    if coarse := too_coarse(f"the {method} estimator {where}", float(standard_mm.max()), limit_mm, least=least):
        return [coarse]
    at = int(np.argmax(error_mm - allowed_mm))
    if error_mm[at] <= allowed_mm[at]:
        return []
    words = f"By the {method} estimator a card {where} is wrong by {error_mm[at]:.3f} mm"
    return [f"{words}; allowed are {allowed_mm[at]:.3f} mm."]


_WALK = (
    "Without correction, weak echoes come out too far (figure 2.15 of the dissertation). Filled: cards that calibrate; "
    "open: cards held back; lines: the fitted correction with its band of two standard deviations."
)
_AFTER = (
    "Mean error of each card after the correction, with two standard errors; the dashed lines are the limits. "
    "Filled: cards that calibrate; open: cards held back, which judge."
)


def _table(measured: Sequence[Level], after: Calibration) -> FloatArray:
    bare = after.model_copy(update={"walk": {}})
    rows = []
    for number, level in enumerate(measured):
        row = [level.gray, float(number % 2)]
        for method in METHODS:
            response, raw = level.ranges(method, bare)
            _, error = level.ranges(method, after)
            single = float(np.std(error, ddof=1))
            row += [float(response.mean()), float(raw.mean()), float(error.mean()), single, single / len(error) ** 0.5]
        rows.append(row)
    return np.array(rows)


def _largest(values: FloatArray) -> float | None:
    return float(np.abs(values).max()) if values.size else None


def _draw_walk(figure: Figure, table: FloatArray, calibration: Calibration) -> None:
    axes = figure.subplots()
    for number, (method, colour) in enumerate(zip(METHODS, COLOURS, strict=False)):
        walk = calibration.walk[method]
        at = np.linspace(*walk.valid_mv, 400)
        curve = walk.at(at)
        axes.plot(at, curve.error_mm, color=colour, lw=1.2, label=f"{method}: correction")
        band = 2 * curve.sd_mm
        axes.fill_between(at, curve.error_mm - band, curve.error_mm + band, color=colour, alpha=0.2)
        for held, face in ((0, colour), (1, "white")):
            chosen = table[table[:, 1] == held]
            axes.plot(chosen[:, 2 + 5 * number], chosen[:, 3 + 5 * number], "o", color=colour, mfc=face, ms=5)
    axes.axvline(STRONG_MV, color="0.5", ls=":", lw=1)
    axes.set(xlabel="response of the photodiode, mV", ylabel="measurement error, mm")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def _draw_after(figure: Figure, table: FloatArray) -> None:
    axes = figure.subplots()
    for number, (method, colour) in enumerate(zip(METHODS, COLOURS, strict=False)):
        for held, face in ((0, colour), (1, "white")):
            chosen = table[table[:, 1] == held]
            response, _, error, _, standard = chosen[:, 2 + 5 * number : 7 + 5 * number].T
            label = f"{method}, {'held back' if held else 'calibrating'}"
            axes.errorbar(
                response, error, yerr=2 * standard, fmt="o", color=colour, mfc=face, ms=5, elinewidth=0.8, label=label
            )
    for limit, start in ((BIAS_LIMIT_MM, STRONG_MV), (WEAK_BIAS_LIMIT_MM, WEAK_MV)):
        for sign in (-1, 1):
            axes.hlines(sign * limit, start, BRIGHT_MV, color="0.4", ls="--", lw=1)
    axes.set(xlabel="response of the photodiode, mV", ylabel="measurement error, mm")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, ncols=2)
