"""How near to the bound the ranging comes, what is left of the timing walk, how fast it is, and whole scans.

    python benchmarks/ranging.py efficiency [--readings 4000] [--seed 1] [--picture FILE]
    python benchmarks/ranging.py walk       [--readings 200]
    python benchmarks/ranging.py throughput
    python benchmarks/ranging.py windows    [--seed 201] [--scans 8] [--sweeps 2]
    python benchmarks/ranging.py memory     [--mode window]
    python benchmarks/ranging.py sensitivity [--only NAME]

Efficiency, walk and throughput take traces from the simulated optics (laser, photodiode, A/D) without firmware. The
calibration is measured first, as on the bench: gray levels before the radar, shapes, noise and walk learnt from the
traces. The bound is computed from the simulator's noise-free pulse and its noise, which the estimators do not know.
Windows and memory scan with the whole simulated bench, through drivers and firmware (`ranging_scans`). Sensitivity
halves and doubles every threshold (`ranging_sensitivity`).
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from ranging_radar import CALIBRATED_MV, DISTANCE_MM, Bound, FloatArray, calibrate, readings
from ranging_scans import memory, windows
from ranging_sensitivity import sensitivity

from picoradar.instrument.calibration import METHODS
from picoradar.instrument.ranging import WindowTraces, estimate, estimate_windows
from picoradar.sim.validation import SWEEPS, TIMES_PS, painted

HELD_BACK_MV = (15.0, 16.3, 17.9, 19.6, 22.0, 25.0, 27.5, 31.0, 36.0, 42.0, 50.0, 58.0, 64.0)
AVERAGES, RESPONSES_MV = (1, 2, 4, 8, 16), (15.0, 20.0, 25.0, 35.0, 45.0, 55.0, 65.0)


def efficiency(seed: int, count: int, picture: Path | None) -> None:
    """Print, and draw, variance over bound, and variance over the reported variance, for responses and averages."""
    calibration, bound = calibrate(1000 * seed), Bound()
    bare = calibration.model_copy(update={"walk": {}})
    print(f"{count} readings of a plate at 1 m; the ratio of two variances is good to {100 * np.sqrt(2 / count):.0f} %")
    print("response averages   bound mm |  half-maximum: rms mm  var/bound |  template: rms mm  var/bound  chi^2")
    ratios = np.empty((2, len(AVERAGES), len(RESPONSES_MV)))
    for number, (sweeps, response) in enumerate(itertools.product(AVERAGES, RESPONSES_MV)):
        bench = painted(100 * seed + number, response, target="plate", distance_mm=DISTANCE_MM)
        traces, true = readings(bench, count, sweeps)
        found = {m: estimate(traces, TIMES_PS, method=m, calibration=bare, sweeps=sweeps) for m in METHODS}
        crossing, fitted = (found[m].range_mm - true - np.mean(found[m].range_mm - true) for m in METHODS)
        best = bound.sd_mm(found["template"], response, sweeps)
        ratio = np.array([crossing.var(), fitted.var()]) / best**2
        ratios[(slice(None), *np.unravel_index(number, ratios.shape[1:]))] = ratio
        reported = np.mean(fitted**2 / found["template"].variance_mm2)
        print(
            f"{response:6.0f} {sweeps:8d} {best:12.4f} | {crossing.std():16.3f} {ratio[0]:14.1f} |"
            f" {fitted.std():15.4f} {ratio[1]:10.2f} {reported:7.2f}"
        )
    if picture:
        draw(ratios, picture)


def draw(ratios: FloatArray, picture: Path) -> None:
    """Draw variance over bound against response, one line for each number of averages."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, style, of_method in zip(METHODS, ("--", "-"), ratios, strict=True):
        for colour, sweeps, values in zip(("C0", "C1", "C2", "C3", "C4"), AVERAGES, of_method, strict=True):
            axes.semilogy(RESPONSES_MV, values, style + "o", color=colour, ms=4, label=f"{name}, {sweeps} averages")
    axes.axhline(1.0, color="black", lw=1)
    axes.axhline(1.1, color="black", lw=1, ls=":")
    axes.set(xlabel="response at the photodiode, mV", ylabel="variance / Cramer-Rao bound", ylim=(0.8, 60))
    axes.legend(fontsize=7, ncols=2, loc="center right")
    figure.savefig(picture, dpi=110)


def walk(seed: int, count: int) -> None:
    """Print bias before and after the correction at responses that were not calibrated."""
    calibration = calibrate(1000 * seed, count)
    bare = calibration.model_copy(update={"walk": {}})
    print(f"calibrated at {np.round(CALIBRATED_MV, 1).tolist()} mV, {count} readings each; held back:")
    print("response |  half-maximum: before  after |  template: before  after  reported sd | standard error")
    for response in HELD_BACK_MV:
        bench = painted(seed + 77, response, target="plate", distance_mm=DISTANCE_MM)
        traces, true = readings(bench, count, SWEEPS)
        row, reported, error = [], 0.0, 0.0
        for method in METHODS:
            for with_calibration in (bare, calibration):
                found = estimate(traces, TIMES_PS, method=method, calibration=with_calibration, sweeps=SWEEPS)
                row.append(float(np.mean(found.range_mm - true)))
            reported, error = float(found.bias_sd_mm.mean()), float(found.range_mm.std() / np.sqrt(count))
        print(
            f"{response:8.1f} | {row[0]:20.3f} {row[1]:6.3f} |"
            f" {row[2]:17.3f} {row[3]:6.3f} {reported:12.3f} | {error:.3f}"
        )


def throughput(seed: int) -> None:
    """Print records a second of processor time, on one core."""
    calibration = calibrate(1000 * seed, 40)
    # Repeated records would have a noise in common, which is noticed.
    traces, _ = readings(painted(seed, 45.0, target="plate", distance_mm=DISTANCE_MM), 2000, 1)
    found = estimate(traces, TIMES_PS, method="template", calibration=calibration)
    pieces = []
    for place in (found.reference_ps, found.echo_ps):
        first = int((np.median(place) - 260.0 - TIMES_PS[0]) / 6.7)
        pieces.append(WindowTraces.of(traces[:, first : first + 96], TIMES_PS[first], 6.7))
    for name, work, count in (
        (
            "half-maximum, 1430 samples",
            lambda: estimate(traces, TIMES_PS, method="half-maximum", calibration=calibration),
            2000,
        ),
        (
            "template, 1430 samples",
            lambda: estimate(traces, TIMES_PS, method="template", calibration=calibration),
            2000,
        ),
        ("template, 2 x 96 samples", lambda: estimate_windows(*pieces, calibration=calibration), 2000),
    ):
        seconds = min(_timed(work))
        print(f"{name:28} {count / seconds:8.0f} records/s")


def _timed(work: object) -> Iterator[float]:
    for _ in range(5):
        began = time.process_time()
        work()  # type: ignore[operator]
        yield time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("efficiency", "walk", "throughput", "windows", "memory", "sensitivity"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--readings", type=int)
    parser.add_argument("--picture", type=Path, help="efficiency: draw into this file")
    parser.add_argument("--scans", type=int, default=8, help="windows: seeds from --seed on, of hip and prism")
    parser.add_argument("--sweeps", type=int, default=0, help="windows: how many of them in sweep mode, too")
    parser.add_argument("--mode", default="window", help="memory: window or sweep")
    parser.add_argument("--only", help="sensitivity: thresholds whose name holds this")
    given = parser.parse_args()
    if given.what == "efficiency":
        efficiency(given.seed, given.readings or 4000, given.picture)
    elif given.what == "walk":
        walk(given.seed, given.readings or 200)
    elif given.what == "throughput":
        throughput(given.seed)
    elif given.what == "sensitivity":
        sensitivity(given.only)
    elif given.what == "windows":
        windows(given.seed, given.scans, given.sweeps)
    else:
        memory(given.mode)


if __name__ == "__main__":
    main()
