"""`gray-target`: timing walk, range zero, pulse shapes and noise from cards of many gray levels (figures 2.14, 2.15).

Cards between black and white stand in turn at a known distance. Every second one calibrates, the ones between are
held back and judge the calibration.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from instrument.calibration import Calibration, Method
from instrument.errors import BadInput
from instrument.procedures.outcome import Outcome, Plot, Readings
from instrument.procedures.stage import Placing
from instrument.procedures.station import Station, traces_of
from instrument.ranging import estimate
from instrument.ranging.learning import learn
from instrument.ranging.walk import fit_walk
from instrument.scan_line import NO_RANGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

NAME = "gray-target"
METHODS: tuple[Method, ...] = ("half-maximum", "template")
WALK_FREE_MV = 40.0  # the range zero is taken above: there the walk is flat (figure 2.15)
WEAK_MV, STRONG_MV, BRIGHT_MV = 15.0, 25.0, 65.0
BIAS_LIMIT_MM, WEAK_BIAS_LIMIT_MM = 0.05, 0.10
LEAST_SPAN = 2.5  # brightest over darkest response: less is no gray wedge
LEAST_SHARE = 0.5  # of the readings of a level that must carry an echo
REFERENCE_ROOM_PS = 150.0


@dataclass(frozen=True)
class Level:
    """Readings of one card: mean traces (R, S) in mV of ``sweeps`` sweeps each, and the card's true distance (mm)."""

    gray: float
    distance_mm: float
    traces_mv: FloatArray
    times_ps: FloatArray
    sweeps: int

    def ranges(self, method: Method, calibration: Calibration) -> tuple[FloatArray, FloatArray]:
        """Return responses (mV) and range errors (mm) of the readings that have an echo."""
        found = estimate(self.traces_mv, self.times_ps, method=method, calibration=calibration, sweeps=self.sweeps)
        good = (found.flags & np.uint16(NO_RANGE)) == 0
        return found.response_mv[good], found.range_mm[good] - self.distance_mm


def run(station: Station, *, distance_mm: float = 1000.0, levels: int = 12, readings: int = 200) -> Outcome:
    """Measure the cards, fit the calibration, and judge it on the cards held back.

    Parameters
    ----------
    station : Station
    distance_mm : float
        Where the cards stand.
    levels : int
        Cards that calibrate; one card less, between them, is held back.
    readings : int
        Readings a card.
    """
    grays = _grays(2 * levels - 1)
    measured: list[Level] = []
    for number, gray in enumerate(grays):
        station.progress(number / len(grays), f"card {number + 1} of {len(grays)}")
        true_mm = station.stage.place(Placing("card", distance_mm, gray=float(gray)))
        traces, times_ps, sweeps = traces_of(station.stare(f"card-{number + 1:02d}", readings))
        measured.append(Level(float(gray), true_mm, traces, times_ps, sweeps))
    if wrong := _misfit(measured, station.calibration):
        return Outcome(NAME, False, [wrong], _REMEDY, ("-", "no calibration was made"), {"levels": len(measured)})
    station.progress(1.0, "fitting")
    calibration = _calibrate(measured[0::2], station.calibration, _provenance(station, distance_mm, levels, readings))
    return _judge(measured, station.calibration, calibration)


_REMEDY = "Put gray cards between black and white at the stated distance, square to the beam, and run this again."


def _grays(count: int) -> FloatArray:
    """Reflectances from white down to where half the walk has long set in, evenly spaced on a logarithmic scale."""
    return np.geomspace(0.9, 0.13, count)


def _misfit(levels: list[Level], calibration: Calibration) -> str:
    """Say in words why these readings cannot be those of gray cards; empty when they can."""
    bare = calibration.model_copy(update={"walk": {}, "reference_ps": None})
    means = []
    for level in levels:
        responses, _ = level.ranges("half-maximum", bare)
        if len(responses) < LEAST_SHARE * len(level.traces_mv):
            lost = len(level.traces_mv) - len(responses)
            return f"{lost} of {len(level.traces_mv)} readings of a card have no echo: lid closed, or nothing there."
        means.append(float(np.median(responses)))
    span = max(means) / min(means)
    if span < LEAST_SPAN:
        return f"The responses differ by a factor of {span:.2f} only: this is no series of gray cards (a plain plate?)."
    if np.any(np.diff(means) > 0.05 * np.array(means[:-1])):
        return "The responses do not fall from card to card: the cards stand in another order than asked for."
    return ""


def _provenance(station: Station, distance_mm: float, levels: int, readings: int) -> str:
    return f"bench procedure {NAME}: {levels} cards x {readings} readings at {distance_mm:g} mm, {station.stage}"


def _calibrate(levels: list[Level], before: Calibration, provenance: str) -> Calibration:
    times, sweeps = levels[0].times_ps, levels[0].sweeps
    templates, noise = learn([level.traces_mv for level in levels], times, sweeps=sweeps)
    bare = before.model_copy(update={"walk": {}, "range_zero_mm": 0.0, "templates": templates, "noise": noise})
    errors = {method: [level.ranges(method, bare) for level in levels] for method in METHODS}
    bright = [error for response, error in errors["half-maximum"] if np.median(response) > WALK_FREE_MV]
    if not bright:
        raise BadInput(f"no card gives more than {WALK_FREE_MV:g} mV; use a whiter one, or stand it nearer")
    zero_mm = -float(np.mean(np.concatenate(bright)))
    shifted = {m: [(response, error + zero_mm) for response, error in errors[m]] for m in METHODS}
    reference = estimate(levels[0].traces_mv, times, calibration=bare, sweeps=sweeps).reference_ps
    middle_ps = float(np.nanmedian(reference))
    return bare.model_copy(
        update={
            "date": datetime.datetime.now(datetime.UTC),
            "provenance": provenance,
            "range_zero_mm": zero_mm,
            "walk": {method: fit_walk(shifted[method]) for method in METHODS},
            "reference_ps": (middle_ps - REFERENCE_ROOM_PS, middle_ps + REFERENCE_ROOM_PS),
        }
    )


def _judge(measured: list[Level], before: Calibration, after: Calibration) -> Outcome:
    bare = after.model_copy(update={"walk": {}})
    rows = []
    for held_back in (False, True):
        for level in measured[1::2] if held_back else measured[0::2]:
            row = [level.gray, float(held_back)]
            for method in METHODS:
                response, raw = level.ranges(method, bare)
                _, error = level.ranges(method, after)
                row += [
                    float(np.mean(response)),
                    float(np.mean(raw)),
                    float(np.mean(error)),
                    float(np.std(error, ddof=1)),
                ]
            rows.append(row)
    table = np.array(rows)
    held = table[table[:, 1] == 1]
    figures: dict[str, float | int | str | bool | None] = {"range_zero_mm": after.range_zero_mm}
    passed = True
    for number, method in enumerate(METHODS):
        response, raw, error = (held[:, 2 + 4 * number + k] for k in range(3))
        strong = (response >= STRONG_MV) & (response <= BRIGHT_MV)
        weak = (response >= WEAK_MV) & (response <= BRIGHT_MV)
        name = method.replace("-", "_")
        figures[f"{name}_bias_25_to_65_mv_mm"] = _largest(error[strong])
        figures[f"{name}_bias_15_to_65_mv_mm"] = _largest(error[weak])
        figures[f"{name}_before_25_to_65_mv_mm"] = _largest(raw[strong])
        figures[f"{name}_before_15_to_65_mv_mm"] = _largest(raw[weak])
        passed &= _within(error[strong], BIAS_LIMIT_MM) and _within(error[weak], WEAK_BIAS_LIMIT_MM)
    worst = figures["template_bias_15_to_65_mv_mm"]
    figures["previous_calibration"] = before.digest
    return Outcome(
        NAME,
        passed,
        [
            f"On {len(held)} cards that the calibration has not seen, the range is wrong by at most {worst:.3f} mm "
            f"from {WEAK_MV:g} to {BRIGHT_MV:g} mV (template); uncorrected it would be "
            f"{figures['template_before_15_to_65_mv_mm']:.2f} mm."
        ],
        "Use calibration.json of this folder: settings, key calibration." if passed else _REMEDY,
        (f"{worst:.3f} mm", "largest bias on cards held back, 15 to 65 mV, template estimator"),
        figures,
        [
            Plot(
                "walk", "Range error against response", _CAPTION_WALK, lambda figure: _draw_walk(figure, table, after)
            ),
            Plot(
                "after", "What is left after the correction", _CAPTION_AFTER, lambda figure: _draw_after(figure, table)
            ),
        ],
        {"levels": Readings(_COLUMNS, table)},
        after,
    )


_COLUMNS = ("reflectance", "held_back") + tuple(
    f"{m.replace('-', '_')}_{what}"
    for m in METHODS
    for what in ("response_mv", "error_before_mm", "error_after_mm", "single_reading_sd_mm")
)
_CAPTION_WALK = (
    "Without correction, weak echoes come out too far (figure 2.15 of the dissertation). Filled: cards that calibrate; "
    "open: cards held back; lines: the fitted correction with its band of two standard deviations."
)
_CAPTION_AFTER = "Mean error of each card after the correction; the dashed lines are the limits."


def _largest(values: FloatArray) -> float | None:
    return float(np.abs(values).max()) if values.size else None


def _within(values: FloatArray, limit_mm: float) -> bool:
    return bool(values.size) and bool(np.abs(values).max() <= limit_mm)


def _draw_walk(figure: Figure, table: FloatArray, calibration: Calibration) -> None:
    axes = figure.subplots()
    for number, (method, colour) in enumerate(zip(METHODS, ("tab:orange", "tab:blue"), strict=True)):
        walk = calibration.walk[method]
        at = np.linspace(*walk.valid_mv, 400)
        curve = walk.at(at)
        axes.plot(at, curve.error_mm, color=colour, lw=1.2, label=f"{method}: correction")
        band = 2 * curve.sd_mm
        axes.fill_between(at, curve.error_mm - band, curve.error_mm + band, color=colour, alpha=0.2)
        for held, face in ((0, colour), (1, "white")):
            chosen = table[table[:, 1] == held]
            axes.plot(chosen[:, 2 + 4 * number], chosen[:, 3 + 4 * number], "o", color=colour, mfc=face, ms=5)
    axes.set(xlabel="response at the photodiode, mV", ylabel="range error, mm")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def _draw_after(figure: Figure, table: FloatArray) -> None:
    axes = figure.subplots()
    for number, (method, colour) in enumerate(zip(METHODS, ("tab:orange", "tab:blue"), strict=True)):
        for held, face in ((0, colour), (1, "white")):
            chosen = table[table[:, 1] == held]
            label = f"{method}, {'held back' if held else 'calibrating'}"
            axes.plot(
                chosen[:, 2 + 4 * number], chosen[:, 4 + 4 * number], "o", color=colour, mfc=face, ms=5, label=label
            )
    for limit, start in ((BIAS_LIMIT_MM, STRONG_MV), (WEAK_BIAS_LIMIT_MM, WEAK_MV)):
        for sign in (-1, 1):
            axes.hlines(sign * limit, start, BRIGHT_MV, color="0.4", ls="--", lw=1)
    axes.set(xlabel="response at the photodiode, mV", ylabel="range error, mm")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, ncols=2)
