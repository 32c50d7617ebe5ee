"""`templates`: learns the pulse shapes and the noise for the template estimator from a few gray cards.

No distances are needed. The timing walk of the template estimator goes with its shapes: run gray-target afterwards,
which learns both at once and needs the cards' distance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from picoradar.instrument.calibration import Calibration, Templates
from picoradar.instrument.procedures.gray_target.level import Level
from picoradar.instrument.procedures.gray_target.procedure import DISTANCE_MM, measure, no_wedge, wedge
from picoradar.instrument.procedures.station.findings import lost_readings, refused
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings
from picoradar.instrument.procedures.station.station import Station
from picoradar.instrument.ranging import learn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "templates"
WHITE, DARKEST = 0.9, 0.1
MIN_GAIN = 2.0  # in standard deviation over the half-maximum estimator
REMEDY = "Put gray cards between white and black at one place, square to the beam, and run this again."


def run(station: Station, *, distance_mm: float = DISTANCE_MM, levels: int = 6, readings: int = 100) -> Outcome:
    """Measure cards, learn the shapes from every second one, and judge them on the others.

    Parameters
    ----------
    station : Station
    distance_mm : float
        Where the cards stand.
    levels : int
        Cards that are learnt from; one less, between them, is held back.
    readings : int
        Readings a card.
    """
    before = station.calibration
    bare = before.model_copy(update={"walk": {}, "reference_ps": None})
    measured: list[Level] = []
    grays = wedge(WHITE, DARKEST, 2 * levels - 1)
    for number, gray in enumerate(grays):
        station.progress(number / len(grays), f"card {number + 1} of {len(grays)}")
        level = measure(station, f"card-{number + 1:02d}", distance_mm, float(gray), readings)
        found = len(level.ranges("half-maximum", bare)[0])
        if lost := lost_readings(found, len(level.traces_mv), f"the card of reflectance {gray:.2f}"):
            return refused(NAME, lost, REMEDY)
        measured.append(level)
    if wrong := no_wedge(measured, before):
        return refused(NAME, wrong, REMEDY)
    learnt = measured[0::2]
    shapes, noise = learn(
        [level.traces_mv for level in learnt], learnt[0].trace.times_ps, sweeps=learnt[0].trace.sweeps
    )
    walk = {method: curve for method, curve in before.walk.items() if method != "template"}
    how = f"bench procedure {NAME}: {levels} cards x {readings} readings, {station.stage}; before: {before.provenance}"
    after = station.stamped(before, how, templates=shapes, noise=noise, walk=walk)
    return _judged(measured[1::2], after, shapes)


def _judged(held: list[Level], after: Calibration, shapes: Templates) -> Outcome:
    bare = after.model_copy(update={"walk": {}})
    rows = []
    for level in held:
        half, by_shape = level.ranges("half-maximum", bare), level.ranges("template", bare)
        rows.append((level.gray, by_shape[0].mean(), half[1].std(ddof=1), by_shape[1].std(ddof=1)))
    table = np.array(rows)
    gain = float(np.min(table[:, 2] / table[:, 3]))
    passed = gain >= MIN_GAIN
    figures: dict[str, float | int | str | bool | None] = {
        "least_gain_in_sd": gain,
        "half_maximum_sd_brightest_mm": float(table[0, 2]),
        "template_sd_brightest_mm": float(table[0, 3]),
        "noise_floor_mv": after.noise.floor_mv,
        "noise_signal_mv": after.noise.signal_mv,
        "noise_signal_share": after.noise.signal_share,
        "noise_jitter_ps": after.noise.jitter_ps,
    }
    return Outcome(
        NAME,
        passed,
        [
            f"On {len(held)} cards that were not learnt from, a reading by templates scatters at least "
            f"{gain:.1f} times less than one at half maximum.",
            "The timing walk of the template estimator goes with its shapes and was taken out of the calibration.",
        ],
        "Run gray-target with this calibration; it makes the timing walk that goes with the shapes."
        if passed
        else REMEDY,
        (f"{gain:.1f} times", "less scatter than at half maximum, at the worst card (at least 2 times)"),
        figures,
        [
            Plot("shapes", "Pulse shapes", _SHAPES, lambda figure: _draw_shapes(figure, shapes)),
            Plot("scatter", "Scatter of a single reading", _SCATTER, lambda figure: _draw_scatter(figure, table)),
        ],
        {"cards": Readings(("reflectance", "response_mv", "half_maximum_sd_mm", "template_sd_mm"), table)},
        after,
    )


_SHAPES = "Reference and echoes at unit peak about their 50 % point: a weaker echo rises more slowly (section 2.6.2)."
_SCATTER = "Standard deviation of one reading on the cards held back, against the response."


def _draw_shapes(figure: Figure, shapes: Templates) -> None:
    from matplotlib import colormaps

    axes = figure.subplots()
    times = shapes.start_ps + shapes.step_ps * np.arange(len(shapes.reference))
    axes.plot(times * 1e-3, shapes.reference, "k--", lw=1.2, label=f"reference, {shapes.reference_mv:.0f} mV")
    colours = colormaps["viridis"]
    for number, (response, echo) in enumerate(zip(shapes.response_mv, shapes.echoes, strict=True)):
        axes.plot(
            times * 1e-3, echo, color=colours(number / len(shapes.echoes)), lw=1.1, label=f"echo, {response:.0f} mV"
        )
    axes.set(xlabel="time about the 50 % point, ns", ylabel="voltage over its peak")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def _draw_scatter(figure: Figure, table: np.ndarray) -> None:
    axes = figure.subplots()
    axes.semilogy(table[:, 1], table[:, 2], "o-", color="tab:orange", label="half-maximum")
    axes.semilogy(table[:, 1], table[:, 3], "o-", color="tab:blue", label="template")
    axes.set(xlabel="response of the photodiode, mV", ylabel="standard deviation of a reading, mm")
    axes.grid(alpha=0.3, which="both")
    axes.legend(frameon=False)
