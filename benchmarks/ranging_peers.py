"""Other ways of ranging beside this one: on the same traces, in both worlds of the simulator.

    python benchmarks/ranging_peers.py [--seed 61] [--readings 400] [--training 200] [--world NAME] [--averages 1 8]

Each method learns from the same training set, 12 gray levels from 10 to 68 mV at 90 cm, in the world it is then tried
in: its range zero, the pulse's form where it asks for one, and its walk, which is fitted by `fit_walk` for all. The
test set is other traces of a plate before the same radar: at 1 m, and, at 150 mV, which saturates the A/D, at 63 cm.
A row is a method; deviation and bias without and with the walk correction, records lost (none found, or off by more
than 20 mm), "honesty" (root mean square of error over stated deviation, where one is stated), and processor time of a
record, one thread.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from ranging_peer_methods import PEERS, Form, Peer, learn_form
from ranging_radar import CALIBRATED_MV, DISTANCE_MM, FloatArray, calibrate, readings, training

from picoradar.instrument.calibration import METHODS, Calibration, Walk
from picoradar.instrument.ranging import RANGE_PER_INTERVAL_MM_PER_PS, estimate, fit_walk
from picoradar.sim.validation import SWEEPS, TIMES_PS, painted
from picoradar.sim.worlds import WORLDS

RESPONSES_MV = (15.0, 45.0, 150.0)
NEAR_MM, NEAR_FROM_MV = 630.0, 70.0  # a white plate at 1 m does not give more
OURS = "picoradar, "
LOST_MM = 20.0
AFTER = 1_000_000  # records: the same radar, later than any of the training set
FORM_MV = 45.0  # the level that a single form is learnt from
MM_A_SAMPLE = RANGE_PER_INTERVAL_MM_PER_PS * float(TIMES_PS[1] - TIMES_PS[0])


class Found(NamedTuple):
    """Ranges (R,) mm but for the zero and the walk, responses (mV), and their stated covariances, NaN where none is."""

    range_mm: FloatArray
    response_mv: FloatArray
    variance_mm2: FloatArray
    response_variance_mv2: FloatArray
    covariance_mm_mv: FloatArray

    def variance_corrected(self, walk: Walk) -> FloatArray:
        """Return the stated variance (mm^2) of ranges whose walk is corrected: the noise of the response moves it."""
        slope = walk.at(self.response_mv).slope_mm_per_mv
        return self.variance_mm2 + slope * (slope * self.response_variance_mv2 - 2 * self.covariance_mm_mv)


Method = Callable[[FloatArray, int], Found]


def by_peer(peer: Peer, form: Form, traces: FloatArray, _: int) -> Found:
    """Range traces one by one."""
    rows = np.full((len(traces), 5), np.nan)
    for row, trace in zip(rows, traces, strict=True):
        try:
            found = peer(trace, form)
        except (ValueError, RuntimeError, IndexError):  # no two pulses, or a fit that does not converge
            continue
        row[:] = found.echo - found.reference, *found[2:]
    return Found(*(rows * [MM_A_SAMPLE, 1.0, MM_A_SAMPLE**2, 1.0, MM_A_SAMPLE]).T)


def by_picoradar(method: str, calibration: Calibration, traces: FloatArray, sweeps: int) -> Found:
    """Range all traces in one call; the variance holds what the response adds where the calibration has a walk."""
    found = estimate(traces, TIMES_PS, method=method, calibration=calibration, sweeps=sweeps)
    nothing = np.zeros(len(traces))
    return Found(found.range_mm, found.response_mv, found.variance_mm2, nothing, nothing)


def methods(calibration: Calibration, form: Form) -> dict[str, Method]:
    """Return all methods by name; ours without zero and walk, which are fitted here for all alike."""
    bare = calibration.model_copy(update={"walk": {}, "range_zero_mm": 0.0})
    ours = {f"{OURS}{m}": partial(by_picoradar, m, bare) for m in METHODS}
    return {name: partial(by_peer, peer, form) for name, peer in PEERS.items()} | ours


class Corrections(NamedTuple):
    """Range zero of a method at the brightest level, and its walk from there."""

    zero_mm: float
    walk: Walk


def correct(method: Method, levels: list[tuple[FloatArray, FloatArray]]) -> Corrections:
    """Fit zero and walk of a method to the training set."""
    found = [method(traces, SWEEPS) for traces, _ in levels]
    errors = [f.range_mm - true for f, (_, true) in zip(found, levels, strict=True)]
    zero = float(np.nanmedian(errors[-1]))
    usable = [np.isfinite(e) for e in errors]
    walk = fit_walk([(f.response_mv[u], (e - zero)[u]) for f, e, u in zip(found, errors, usable, strict=True)])
    return Corrections(zero, walk)


def row(method: Method, stating: Method, own: Corrections, test: tuple[FloatArray, FloatArray], sweeps: int) -> str:
    """Try a method on a test set; ``stating`` is what its stated variance is asked of."""
    traces, true_mm = test
    method(traces[:2], sweeps)  # tables and caches are not counted
    began = time.process_time()
    found = method(traces, sweeps)
    micros = 1e6 * (time.process_time() - began) / len(traces)
    before = found.range_mm - own.zero_mm - true_mm
    there = np.isfinite(before) & (np.abs(before) < LOST_MM)
    if there.sum() < 2:
        return f"{'all lost':>51} {micros:8.0f}"
    after = (before - own.walk.at(found.response_mv).error_mm)[there]
    before = before[there]
    stated = stating(traces, sweeps).variance_corrected(own.walk)[there]
    honesty = f"{np.sqrt(np.mean(after**2 / stated)):8.2f}" if np.isfinite(stated).all() else f"{'none':>8}"
    return (
        f"{before.std():7.3f} {before.mean():7.3f} | {after.std():7.3f} {after.mean():7.3f} | "
        f"{100 * (1 - there.mean()):6.1f} {honesty} {micros:8.0f}"
    )


def compare(world: str, seed: int, count: int, train: int, averages: list[int]) -> None:
    """Print the table of a world."""
    levels = training(1000 * seed, train, world)
    calibration = calibrate(1000 * seed, train, world)
    form = learn_form(levels[int(np.argmin(np.abs(CALIBRATED_MV - FORM_MV)))][0])
    every = methods(calibration, form)
    stating = every | {f"{OURS}{m}": partial(by_picoradar, m, calibration) for m in METHODS}
    corrections = {name: correct(method, levels) for name, method in every.items()}
    for k, sweeps in enumerate(averages):
        for j, response in enumerate(RESPONSES_MV):
            away = DISTANCE_MM if response < NEAR_FROM_MV else NEAR_MM
            bench = painted(1000 * seed, response, target="plate", distance_mm=away, world=world)
            test = readings(bench, count, sweeps, after=AFTER * (1 + len(RESPONSES_MV) * k + j))
            print(f"\n{world}, {response:g} mV, averages {sweeps}")
            print(f"{'method':24} without walk: sd, bias mm | with walk: sd, bias | lost % honesty   CPU us")
            for name, method in every.items():
                print(f"{name:24} {row(method, stating[name], corrections[name], test, sweeps)}", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=61)
    parser.add_argument("--readings", type=int, default=400)
    parser.add_argument("--training", type=int, default=200, help="readings of each gray level")
    parser.add_argument("--world", choices=tuple(WORLDS))
    parser.add_argument("--averages", type=int, nargs="+", default=[1, 8])
    asked = parser.parse_args()
    for world in [asked.world] if asked.world else WORLDS:
        compare(world, asked.seed, asked.readings, asked.training, asked.averages)


if __name__ == "__main__":
    main()
