"""Whether the 95 % band of the walk calibration holds 95 % of the errors, on levels that were not measured.

    python benchmarks/walk_band.py walk     [--seeds 200]   levels drawn about known curves
    python benchmarks/walk_band.py unseen   [--seeds 200]   cards before the simulated receiver

The error is that of the corrected mean of many readings at one response, anywhere between the levels.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import METHODS, Calibration, Walk
from picoradar.instrument.procedures.gray_target import DARKEST, WHITE, wedge
from picoradar.instrument.ranging import estimate, fit_walk, learn
from picoradar.sim.validation import SWEEPS, TIMES_PS, Bench, painted

FloatArray = NDArray[np.float64]

READING_SD = {"half-maximum": (0.20, 3.2), "template": (0.035, 0.75)}  # mm: a + b / response, as gray-target reports
LEVELS, READINGS = 12, 200
TRUE_LEVELS, TRUE_READINGS = 45, 2000
JUDGED_MV = np.geomspace(15.0, 94.0, 80)
LAWS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "logistic": lambda r: 8.0 / (1.0 + np.exp((r - 13.0) / 3.5)),
    "exponential": lambda r: 5.3 * np.exp((15.0 - r) / 4.5),
    "power": lambda r: 5.3 * (15.0 / r) ** 3,
}


def shipped() -> Calibration:
    """Load the calibration that comes with the simulated bench."""
    with resources.as_file(resources.files("picoradar.instrument") / "data" / "simulated-bench.json") as path:
        return Calibration.load(path)


def walk(seeds: int) -> None:
    """Fit the walk to levels drawn about known curves; count how often the band holds the error of the fit."""
    at = np.geomspace(15.0, 60.0, 60)
    for method in METHODS:
        fixed, inverse = READING_SD[method]
        own = shipped().walk[method]
        laws: dict[str, Callable[[FloatArray], FloatArray]] = {"the curve that ships": partial(_known, own), **LAWS}
        for name, law in laws.items():
            inside = 0
            for seed in range(seeds):
                rng = np.random.default_rng([seed, 1])
                levels = []
                for response in np.geomspace(9.0, 63.0, LEVELS) * rng.uniform(0.98, 1.02, LEVELS):
                    errors = law(np.array([response]))[0] + rng.normal(0, fixed + inverse / response, READINGS)
                    levels.append((response + rng.normal(0, 0.05, READINGS), errors))
                curve = fit_walk(levels).at(at)
                inside += int(np.count_nonzero(np.abs(curve.error_mm - law(at)) <= 1.96 * curve.sd_mm))
            print(f"walk, {method}, {name}: the 95 % band holds {100 * inside / (seeds * at.size):.1f} % of the errors")


def _known(curve: Walk, response_mv: FloatArray) -> FloatArray:
    return curve.at(response_mv).error_mm


def unseen(seeds: int) -> None:
    """Calibrate on simulated gray cards, and judge the band between them.

    The truth is a fit to nearly four times as many cards with ten times as many readings; its own uncertainty is
    counted in. Each seed takes fresh readings. Pulse shapes are learnt once, from readings of their own.
    """
    cards = [_card(k, float(response)) for k, response in enumerate(95.0 * wedge(WHITE, DARKEST, LEVELS) / WHITE)]
    templates, noise = learn([_readings(card, READINGS)[0] for card in cards], TIMES_PS, sweeps=SWEEPS)
    bare = shipped().model_copy(update={"templates": templates, "noise": noise, "walk": {}, "reference_ps": None})
    every = [_card(100 + k, float(r)) for k, r in enumerate(95.0 * wedge(WHITE, DARKEST, TRUE_LEVELS) / WHITE)]
    found = [_ranged(card, TRUE_READINGS, bare) for card in every]
    true = {method: fit_walk([one[method] for one in found]) for method in METHODS}
    scores: dict[str, list[FloatArray]] = {method: [] for method in METHODS}
    for _ in range(seeds):
        found = [_ranged(card, READINGS, bare) for card in cards]
        for method in METHODS:
            walk, known = (w.at(JUDGED_MV) for w in (fit_walk([one[method] for one in found]), true[method]))
            scores[method].append((walk.error_mm - known.error_mm) / np.hypot(walk.sd_mm, known.sd_mm))
    for method in METHODS:
        table = np.array(scores[method])
        inside = 100 * np.mean(np.abs(table) <= 1.96)
        print(f"unseen, {method}: the 95 % band holds {inside:.1f} % of the errors from 15 to 94 mV over {seeds} seeds")
        print(f"  root mean square of error over standard deviation {np.sqrt(np.mean(table**2)):.2f}")


def _card(number: int, response_mv: float) -> Bench:
    return painted(300 + number, response_mv, target="plate", distance_mm=800.0)


def _readings(card: Bench, count: int) -> tuple[FloatArray, FloatArray]:
    """Take traces (R, S) mV with their true ranges (R,) mm."""
    taken = [card.take() for _ in range(count)]
    return np.stack([trace for trace, _ in taken]), np.array([truth.range_mm for _, truth in taken])


def _ranged(card: Bench, count: int, bare: Calibration) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Take readings and return responses and range errors by each method."""
    traces, true_mm = _readings(card, count)
    found = {m: estimate(traces, TIMES_PS, method=m, calibration=bare, sweeps=SWEEPS) for m in METHODS}
    return {m: (ranges.response_mv, ranges.range_mm - true_mm) for m, ranges in found.items()}


def main() -> None:
    """Run one of the comparisons."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("walk", "unseen"))
    parser.add_argument("--seeds", type=int, default=200)
    wanted = parser.parse_args()
    {"walk": walk, "unseen": unseen}[wanted.what](wanted.seeds)


if __name__ == "__main__":
    main()
