"""`distance`: single-point series (figure 2.13), dependence on distance, effect of averaging, and the overlap limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, Method
from picoradar.instrument.line import Flag
from picoradar.instrument.procedures.station.certainty import too_coarse
from picoradar.instrument.procedures.station.findings import lost_readings, refused
from picoradar.instrument.procedures.station.measured import Measured
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Station
from picoradar.instrument.settings import MIN_DISTANCE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

NAME = "distance"
SERIES_MM, SERIES_AVERAGES, SERIES_READINGS = 1000.0, 8, 1600
DISTANCES_MM = (640.0, 690.0, 740.0, 790.0, 840.0, 890.0, 940.0, 1000.0)
NEAR_MM = tuple(range(560, 661, 10))
AVERAGES = (1, 2, 4, 8, 16, 32, 64)
GRAY_AT_1_M = 0.7  # reflectance that gives about 50 mV at 1 m
LARGEST_MM = 1.0  # of a single reading at 1 m with 8 averages (section 2.4, figure 2.13: 0.875)
CHANCE = 0.002  # share of readings beyond it that is no defect; one reading always is chance
FAR_OFF_MM = 10.0  # no range zero is so wrong
MEAN_MM = 0.3  # of the mean at any distance of the range
BAD_FLAGS = Flag.NO_ECHO | Flag.NO_REFERENCE | Flag.OVERLAPPED
REMEDY = (
    "Put the plate square to the beam at the stated distances, check the laser with gray-target, and run this again."
)


@dataclass(frozen=True)
class Series:
    """Errors (mm, NaN without a range) of the readings at one distance with some averages, and which were flagged."""

    distance_mm: float
    averages: int
    error_mm: FloatArray
    flagged: NDArray[np.bool_]

    @property
    def good(self) -> FloatArray:
        """Get the errors of the readings that have a range."""
        return self.error_mm[np.isfinite(self.error_mm)]


def run(station: Station, *, readings: int = SERIES_READINGS, short: int = 48) -> Outcome:
    """Take the series and judge them.

    Parameters
    ----------
    station : Station
    readings : int
        Readings of the series at 1 m.
    short : int
        Readings of every other series.
    """
    asked = [(SERIES_MM, SERIES_AVERAGES, readings)]
    asked += [(mm, SERIES_AVERAGES, short) for mm in DISTANCES_MM]
    asked += [(SERIES_MM, averages, short) for averages in AVERAGES]
    asked += [(float(mm), SERIES_AVERAGES, short // 3) for mm in NEAR_MM]
    taken: dict[Method, list[Series]] = {"half-maximum": [], station.best_method: []}
    for number, (distance_mm, averages, count) in enumerate(asked):
        station.progress(number / len(asked), f"{distance_mm:g} mm, {averages} averages")
        reported_mm = station.stage.place(
            Placing("plate", distance_mm, gray=round(GRAY_AT_1_M * (distance_mm / 1000) ** 2, 2))
        )
        measured = station.dwell(f"series-{number + 1:02d}", count, averages=averages)
        for method, series in taken.items():
            series.append(_ranged(measured, method, station.calibration, reported_mm, averages))
        if distance_mm >= DISTANCES_MM[0] and (wrong := _wrong(taken["half-maximum"][-1])):
            return refused(NAME, wrong, REMEDY)
    station.progress(1.0, "evaluating")
    return _judged(taken)


def _wrong(series: Series) -> str:
    """Say why a series cannot be that of a plate where it was reported to be; empty when it can."""
    if lost := lost_readings(len(series.good), len(series.error_mm), f"the plate at {series.distance_mm:g} mm"):
        return lost
    off_mm = float(np.median(series.good))
    if abs(off_mm) > FAR_OFF_MM:
        return (
            f"The plate reported to stand at {series.distance_mm:g} mm was found {abs(off_mm):.0f} mm off: "
            "another body, or it stands elsewhere."
        )
    return ""


def _ranged(measured: Measured, method: Method, calibration: Calibration, nominal_mm: float, averages: int) -> Series:
    found = measured.ranges(method, calibration)
    flagged = (found.flags & np.uint16(BAD_FLAGS)) != 0
    return Series(nominal_mm, averages, found.range_mm - nominal_mm, flagged)


def _judged(taken: dict[Method, list[Series]]) -> Outcome:
    ends = np.cumsum([1, len(DISTANCES_MM), len(AVERAGES), len(NEAR_MM)])
    figures: dict[str, float | int | str | bool | None] = {}
    parts: dict[Method, list[Sequence[Series]]] = {}
    broken: list[str] = []
    for method, every in taken.items():
        first, far, averaged, near = (every[a:b] for a, b in zip([0, *ends[:-1]], ends, strict=True))
        parts[method] = [first, far, averaged, near]
        title = method.replace("-", "_")
        largest = float(np.abs(first[0].good - first[0].good.mean()).max())
        means = np.array([s.good.mean() if s.good.size else np.nan for s in far])
        figures[f"{title}_largest_of_series_mm"] = largest
        figures[f"{title}_sd_of_series_mm"] = float(first[0].good.std(ddof=1))
        figures[f"{title}_mean_of_series_mm"] = float(first[0].good.mean())
        figures[f"{title}_largest_mean_over_distance_mm"] = _finite(np.abs(means).max())
        figures[f"{title}_sd_exponent_over_averages"] = _exponent(averaged)
        figures[f"{title}_overlap_limit_mm"] = _overlap_limit([*near, *far])
        within = float(np.mean(np.abs(first[0].good - first[0].good.mean()) <= LARGEST_MM))
        figures[f"{title}_within_1_mm_share"] = within
        beyond = round((1.0 - within) * len(first[0].good))
        if beyond > max(1, CHANCE * len(first[0].good)):
            broken.append(f"By the {method} estimator {beyond} readings at 1 m are more than {LARGEST_MM:g} mm off.")
        broken += _broken_means(method, far, means)
    passed = not broken
    largest_mm = figures["half_maximum_largest_of_series_mm"]
    limit = figures["half_maximum_overlap_limit_mm"]
    finding = (
        f"At 1 m with {SERIES_AVERAGES} averages, {len(taken['half-maximum'][0].good)} readings at half maximum lie "
        f"within +-{largest_mm:.2f} mm of their mean (dissertation: 0.875 mm)."
    )
    overlap = "no distance" if limit is None else f"{limit:.0f} mm"
    return Outcome(
        NAME,
        passed,
        [
            finding,
            f"Reference and echo are told apart from {overlap} on (dissertation: {MIN_DISTANCE.value:g} mm).",
            *broken,
        ],
        "Nothing to do." if passed else REMEDY,
        (f"±{largest_mm:.2f} mm", f"largest of all readings at 1 m, {SERIES_AVERAGES} averages, half maximum"),
        figures,
        [
            Plot("series", "Measurement uncertainty at 1 m", _SERIES, lambda f: _draw_series(f, parts)),
            Plot("distance", "Dependence on distance and on averaging", _REST, lambda f: _draw_rest(f, parts)),
        ],
        {"series": _readings(taken)},
    )


def _broken_means(method: Method, far: Sequence[Series], means: FloatArray) -> list[str]:
    """Say why the means at the distances of the range do not pass: too uncertain, or beyond the limit."""
    standard = [s.good.std(ddof=1) / len(s.good) ** 0.5 if len(s.good) > 1 else np.nan for s in far]
    if coarse := too_coarse(f"the means of the {method} estimator", float(np.max(standard)), MEAN_MM):
        return [coarse]
    worst = int(np.argmax(np.abs(means)))
    if abs(means[worst]) <= MEAN_MM:
        return []
    where = f"at {far[worst].distance_mm:g} mm"
    return [f"By the {method} estimator the mean {where} is {means[worst]:+.2f} mm off; {MEAN_MM:g} mm are allowed."]


_SERIES = "Each reading less the mean of the series, as in figure 2.13 of the dissertation."
_REST = (
    "Left: mean error against distance with two standard errors; shaded: where reference and echo overlap. Right: "
    "standard deviation of a reading against averages; the dashed lines fall as one over the square root."
)


def _exponent(averaged: Sequence[Series]) -> float:
    """Slope of the standard deviation over the averages, both logarithmic; -0.5 for independent noise."""
    x = np.log([s.averages for s in averaged])
    return float(np.polyfit(x, np.log([s.good.std(ddof=1) for s in averaged]), 1)[0])


def _overlap_limit(series: Sequence[Series]) -> float | None:
    """Return the least distance from which on all series are free of overlap and right within 1 mm."""
    limit = None
    for one in sorted(series, key=lambda s: -s.distance_mm):
        wrong = one.flagged | ~(np.abs(one.error_mm) < LARGEST_MM)
        if wrong.mean() > 0.05:
            break
        limit = one.distance_mm
    return limit


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _readings(taken: dict[Method, list[Series]]) -> Readings:
    columns = ("distance_mm", "averages", *(f"{method.replace('-', '_')}_error_mm" for method in taken))
    blocks = []
    for same in zip(*taken.values(), strict=True):
        count = len(same[0].error_mm)
        fixed = [np.full(count, same[0].distance_mm), np.full(count, same[0].averages)]
        blocks.append(np.column_stack([*fixed, *(s.error_mm for s in same)]))
    return Readings(columns, np.vstack(blocks))


def _draw_series(figure: Figure, parts: dict[Method, list[Sequence[Series]]]) -> None:
    axes = figure.subplots()
    for method, (first, *_) in parts.items():
        errors = first[0].good
        axes.plot(errors - errors.mean(), lw=0.5, label=f"{method}: standard deviation {errors.std(ddof=1):.2f} mm")
    axes.set(xlabel="measured range data", ylabel="measurement uncertainty, mm", ylim=(-1.2, 1.2))
    for limit in (-0.875, 0.875):
        axes.axhline(limit, color="0.4", ls="--", lw=1)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, loc="lower right", ncols=2)


def _draw_rest(figure: Figure, parts: dict[Method, list[Sequence[Series]]]) -> None:
    left, right = figure.subplots(1, 2)
    for number, (method, (_, far, averaged, _)) in enumerate(parts.items()):
        place = [s.distance_mm / 10 for s in far]
        two_errors = [2 * s.good.std(ddof=1) / len(s.good) ** 0.5 for s in far]
        left.errorbar(place, [s.good.mean() for s in far], two_errors, fmt="o", ms=4, label=method)
        x = np.array([s.averages for s in averaged])
        sd = np.array([s.good.std(ddof=1) for s in averaged])
        right.loglog(x, sd, "o", ms=4, color=f"C{number}", label=method)
        right.loglog(x, sd[0] * (x / x[0]) ** -0.5, "--", lw=1, color=f"C{number}")
    limit = _overlap_limit([*parts["half-maximum"][3], *parts["half-maximum"][1]])
    if limit is not None:
        left.axvspan(NEAR_MM[0] / 10, limit / 10, color="0.85")
    left.set(xlabel="distance, cm", ylabel="mean error, mm", xlim=(NEAR_MM[0] / 10, 102))
    right.set(xlabel="averages", ylabel="standard deviation of a reading, mm")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
