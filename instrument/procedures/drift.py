"""`drift`: range and timing walk over hours, with and without the reference; Allan deviation; warm-up time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.procedures.station.certainty import too_coarse
from picoradar.instrument.procedures.station.findings import lost_readings, refused
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Station
from picoradar.instrument.ranging import RANGE_PER_INTERVAL_MM_PER_PS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

NAME = "drift"
BRIGHT, DARK = 0.7, 0.28  # reflectances; their difference shows whether the walk drifts
LIMIT_MM = 0.1  # of the mean range with the reference, over the whole time
WARM_SDS = 4.0  # of the wander of a warm radar; more is a warm-up
ATTEMPT_S = 18 * 60.0  # the scan of section 2.5 whose reference was taken once, at its beginning
ALLOWED_MM = 1.0  # that the dissertation asks of a distance (section 2.5)
FAR_OFF_MM = 10.0  # no range zero is so wrong
MIN_DARKER = 1.5  # bright response over dark; 2.5 is asked for
REMEDY = "Leave the plate where it is for the whole time, keep the room steady, and run this again."


def run(station: Station, *, hours: float = 2.0, interval_s: float = 120.0, readings: int = 10) -> Outcome:
    """Monitor a plate for hours, and a darker one at the end.

    Parameters
    ----------
    station : Station
    hours : float
        How long.
    interval_s : float
        From one group of readings to the next.
    readings : int
        Readings in a group.
    """
    station.progress(0.0, "monitoring the plate")
    reported_mm = station.stage.place(Placing("plate", 1000.0, gray=BRIGHT))
    groups = max(int(hours * 3600 / interval_s), 10)
    bright = _monitored(station, "bright", groups, readings, interval_s)
    if lost := lost_readings(int(np.isfinite(bright.range_mm).sum()), bright.range_mm.size, "the plate"):
        return refused(NAME, lost, REMEDY)
    station.progress(0.8, "monitoring a darker plate")
    station.stage.place(Placing("plate", 1000.0, gray=DARK))
    dark = _monitored(station, "dark", max(groups // 4, 5), readings, interval_s)
    if lost := lost_readings(int(np.isfinite(dark.range_mm).sum()), dark.range_mm.size, "the darker plate"):
        return refused(NAME, lost, REMEDY)
    off_mm = float(np.nanmedian(bright.range_mm)) - reported_mm
    if abs(off_mm) > FAR_OFF_MM:
        found = (
            f"The plate asked for at {reported_mm:g} mm was found {abs(off_mm):.0f} mm off: another body, or elsewhere."
        )
        return refused(NAME, found, REMEDY)
    darker = float(np.nanmedian(bright.response_mv) / np.nanmedian(dark.response_mv))
    if darker < MIN_DARKER:
        asked = f"asked was a factor of {BRIGHT / DARK:.1f}"
        found = f"The second plate is not darker: its echo is weaker by {darker:.2f} times, {asked}."
        return refused(NAME, found, REMEDY)
    return _judged(bright, dark, reported_mm, interval_s)


@dataclass(frozen=True)
class Groups:
    """Groups of readings: begin (G,) s; range, time-significant point of the echo, response (G, R) in mm, ps, mV."""

    times_s: FloatArray
    range_mm: FloatArray
    echo_ps: FloatArray
    response_mv: FloatArray

    @property
    def mean_mm(self) -> FloatArray:
        """Get the mean range (G,) of each group."""
        return np.asarray(np.nanmean(self.range_mm, axis=1))

    @property
    def alone_mm(self) -> FloatArray:
        """Get the error (G,) of ranges whose reference was taken once, with the first group."""
        alone = np.nanmean(self.echo_ps, axis=1) * RANGE_PER_INTERVAL_MM_PER_PS
        return np.asarray(alone - alone[0])

    @property
    def once_mm(self) -> float:
        """Get the largest of these errors in the time of the attempt of section 2.5."""
        return float(np.abs(self.alone_mm[self.times_s <= ATTEMPT_S]).max())

    @property
    def once_good_for_s(self) -> float | None:
        """Get for how long such a reference would do; None when it does to the end."""
        spoilt = np.flatnonzero(np.abs(self.alone_mm) > ALLOWED_MM)
        return float(self.times_s[spoilt[0]]) if spoilt.size else None


def _monitored(station: Station, name: str, groups: int, readings: int, interval_s: float) -> Groups:
    measured = station.monitor(name, groups, readings, interval_s)
    found = measured.ranges(station.best_method, station.calibration)
    shape = (groups, readings)
    times_s = measured.began_s.reshape(shape)[:, 0]
    ranges, echoes, responses = (x.reshape(shape) for x in (found.range_mm, found.echo_ps, found.response_mv))
    return Groups(times_s - times_s[0], ranges, echoes, responses)


def _judged(bright: Groups, dark: Groups, reported_mm: float, interval_s: float) -> Outcome:
    error = bright.mean_mm - bright.mean_mm.mean()
    standard = float(np.nanmedian(np.nanstd(bright.range_mm, axis=1, ddof=1)) / bright.range_mm.shape[1] ** 0.5)
    spans, with_reference = allan_deviation(bright.mean_mm, interval_s)
    _, without = allan_deviation(bright.alone_mm, interval_s)
    wander = float(bright.alone_mm.std(ddof=1))
    warm_s = warm_after(bright.times_s, bright.alone_mm)
    largest, alone = float(np.abs(error).max()), float(np.abs(bright.alone_mm).max())
    coarse = too_coarse("the drift", standard, LIMIT_MM)
    passed = largest <= LIMIT_MM and not coarse
    figures: dict[str, float | int | str | bool | None] = {
        "hours": float(bright.times_s[-1] / 3600),
        "largest_with_reference_mm": largest,
        "largest_without_reference_mm": alone,
        "reference_once_largest_in_18_min_mm": bright.once_mm,
        "reference_once_within_1_mm_for_s": bright.once_good_for_s,
        "standard_error_of_a_group_mm": standard,
        "mean_error_mm": float(bright.mean_mm.mean() - reported_mm),
        "walk_between_bright_and_dark_mm": float(dark.mean_mm.mean() - bright.mean_mm.mean()),
        "walk_drift_mm": float(np.abs(dark.mean_mm - dark.mean_mm.mean()).max()),
        "least_allan_deviation_mm": float(with_reference.min()),
        "best_averaging_time_s": float(spans[np.argmin(with_reference)]),
        "warm_after_s": warm_s,
        "wander_without_reference_mm": wander,
    }
    if warm_s is None:
        warm = "The timing without reference still goes one way at the end: run it longer for the end of the warm-up."
    elif warm_s == 0.0:
        warm = (
            f"No warm-up is left once the diode is stable: from the first minute the timing wanders by {wander:.1f} mm."
        )
    else:
        warm = f"The radar is warm {warm_s / 60:.0f} min after the diode is stable; then it wanders by {wander:.1f} mm."
    return Outcome(
        NAME,
        passed,
        [
            f"In {figures['hours']:.1f} h the range moved by at most {largest:.3f} mm with the reference in every "
            f"record, and by {alone:.2f} mm with the echo alone.",
            _taken_once(bright),
            f"{warm} The reference in every record takes it out.",
            *([coarse] if coarse else []),
        ],
        "Nothing to do." if passed else REMEDY,
        (f"{largest:.3f} mm", "largest change of the range with reference (at most 0.1 mm)"),
        figures,
        [
            Plot("time", "Range over time", _TIME, lambda figure: _draw_time(figure, bright, error)),
            Plot("allan", "Allan deviation", _ALLAN, lambda f: _draw_allan(f, spans, with_reference, without)),
        ],
        {"bright": _readings(bright), "dark": _readings(dark)},
    )


def _taken_once(monitored: Groups) -> str:
    """What ranges would be like if the reference were taken once, as the dissertation tried (section 2.5)."""
    found = f"With a reference taken once, ranges would be off by up to {monitored.once_mm:.2f} mm within 18 min"
    good_s = monitored.once_good_for_s
    if good_s is None:
        return f"{found}, and within {ALLOWED_MM:g} mm to the end."
    return f"{found}; it would be spoilt (by more than {ALLOWED_MM:g} mm) after {good_s / 60:.0f} min."


_TIME = "Means of the groups: with the reference in every record, and with the echo alone as if it were measured once."
_ALLAN = "Falling as one over the square root: noise. Rising: drift. The dashed line is noise alone."


def allan_deviation(values: FloatArray, interval_s: float) -> tuple[FloatArray, FloatArray]:
    """Return averaging times (s) and overlapping Allan deviations of evenly spaced values.

    For m values at a time: half the mean square of the differences of neighbouring means (Allan, Proc. IEEE 54 (1966)
    221; overlapping as in Riley, NIST SP 1065, eq. 9).
    """
    sums = np.concatenate([[0.0], np.cumsum(values)])
    sizes = np.unique(np.geomspace(1, max(len(values) // 3, 1), 12).astype(int))
    result = []
    for m in sizes:
        means = (sums[m:] - sums[:-m]) / m
        result.append(np.sqrt(0.5 * np.mean((means[m:] - means[:-m]) ** 2)))
    return sizes * interval_s, np.array(result)


def warm_after(times_s: FloatArray, values: FloatArray) -> float | None:
    """Return from when on the values wander no more than they do in the second half of the time.

    A warm-up shows as values outside `WARM_SDS` standard deviations of the second half about its mean. None when the
    second half itself goes one way: then the end of the warm-up is not in sight.
    """
    half = len(values) // 2
    late = values[half:]
    middle, wander = float(late.mean()), float(late.std(ddof=1))
    first, last = late[: len(late) // 2], late[len(late) // 2 :]
    if abs(float(first.mean() - last.mean())) > 2.0 * float(np.hypot(first.std(ddof=1), last.std(ddof=1))):
        return None
    cold = np.flatnonzero(np.abs(values - middle) > WARM_SDS * wander)
    return float(times_s[cold[-1] + 1] if cold.size else times_s[0])


def _readings(monitored: Groups) -> Readings:
    columns = ("time_s", "without_reference_mm", *(f"range_{n + 1}_mm" for n in range(monitored.range_mm.shape[1])))
    return Readings(columns, np.column_stack([monitored.times_s, monitored.alone_mm, monitored.range_mm]))


def _draw_time(figure: Figure, monitored: Groups, error: FloatArray) -> None:
    axes = figure.subplots()
    minutes = monitored.times_s / 60
    axes.plot(minutes, monitored.alone_mm, "o-", ms=3, lw=0.8, color="tab:orange", label="without reference")
    axes.plot(minutes, error, "o-", ms=3, lw=0.8, color="tab:blue", label="with reference")
    axes.set(xlabel="time, min", ylabel="change of the range, mm")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def _draw_allan(figure: Figure, spans: FloatArray, with_reference: FloatArray, without: FloatArray) -> None:
    axes = figure.subplots()
    axes.loglog(spans, without, "o-", color="tab:orange", label="without reference")
    axes.loglog(spans, with_reference, "o-", color="tab:blue", label="with reference")
    axes.loglog(spans, with_reference[0] * (spans / spans[0]) ** -0.5, "--", color="0.5", lw=1)
    axes.set_xticks(spans, [f"{span:g}" for span in spans])
    axes.minorticks_off()
    axes.set(xlabel="averaging time, s", ylabel="Allan deviation of the range, mm")
    axes.grid(alpha=0.3, which="both")
    axes.legend(frameon=False)
