"""How near to the bound the ranging comes, what is left of the timing walk, and how fast it is.

    python benchmarks/ranging.py efficiency [--readings 1000] [--seed 1] [--picture FILE]
    python benchmarks/ranging.py walk       [--readings 200]
    python benchmarks/ranging.py windows    [--target hip] [--wanted-mm 0.2]
    python benchmarks/ranging.py throughput

The traces come from the simulated optics (laser, photodiode, A/D) without firmware. The calibration is measured first,
as on the bench: gray levels before the radar, shapes, noise and walk learnt from the traces. The bound is computed
from the simulator's noise-free pulse and its noise, which the estimators do not know.
"""

from __future__ import annotations

import argparse
import datetime
import itertools
import time
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from instrument.calibration import METHODS, Calibration
from instrument.geometry import CENTRE_CODE
from instrument.ranging import (
    Place,
    PlanSettings,
    Pulse,
    Ranges,
    WindowPlanner,
    WindowTraces,
    estimate,
    estimate_places,
    estimate_windows,
    fit_walk,
    learn,
    range_bound_mm2,
    with_retaken,
)
from instrument.raster import Raster
from instrument.scan_line import SUSPECT
from sim.receiver import TABLE_PS, Receiver
from sim.settings import SimulationSettings
from sim.transmitter import OPERATING_DEGC, OPERATING_V, Transmitter
from sim.validation.bench import PRF_HZ, SWEEPS, TIMES_PS, Bench, painted
from sim.wires import Acquisition

FloatArray = NDArray[np.float64]

DISTANCE_MM = 1000.0
CALIBRATED_MV = np.geomspace(10.0, 68.0, 12)
HELD_BACK_MV = (15.0, 16.3, 17.9, 19.6, 22.0, 25.0, 27.5, 31.0, 36.0, 42.0, 50.0, 58.0, 64.0)
AVERAGES, RESPONSES_MV = (1, 4, 8, 16), (15.0, 25.0, 35.0, 45.0, 55.0, 65.0)
SETTLE_SHOTS = 16
SIZE = 40
STEP_SETTLE_S, FLYBACK_S = 0.5e-3, 8e-3  # mirrors: servo time 0.2 ms


def readings(bench: Bench, count: int, sweeps: int) -> tuple[FloatArray, FloatArray]:
    """Return traces (R, S) mV and true ranges (R,) mm."""
    taken = [bench.take(sweeps=sweeps) for _ in range(count)]
    return np.stack([trace for trace, _ in taken]), np.array([truth.range_mm for _, truth in taken])


@lru_cache(maxsize=1)
def calibrate(seed: int, count: int = 200) -> Calibration:
    """Do the bench procedure: 12 gray levels, 8 sweeps a reading."""
    benches = [
        painted(seed + k, level, target="plate", distance_mm=DISTANCE_MM) for k, level in enumerate(CALIBRATED_MV)
    ]
    series = [readings(bench, count, SWEEPS) for bench in benches]
    templates, noise = learn([traces for traces, _ in series], TIMES_PS, sweeps=SWEEPS)
    bare = Calibration(
        date=datetime.datetime.now(datetime.UTC),
        provenance="benchmarks/ranging.py",
        mirror_separation_mm=benches[0].settings.mirror_separation_mm,
        templates=templates,
        noise=noise,
    )
    found = {
        method: [estimate(x, TIMES_PS, method=method, calibration=bare, sweeps=SWEEPS) for x, _ in series]
        for method in METHODS
    }
    brightest = found["template"][-1]
    zero = float(np.mean(series[-1][1] - brightest.range_mm))
    walk = {
        method: fit_walk(
            [(r.response_mv, r.range_mm + zero - true) for r, (_, true) in zip(found[method], series, strict=True)]
        )
        for method in METHODS
    }
    place = float(np.median(brightest.reference_ps))
    return bare.model_copy(update={"range_zero_mm": zero, "walk": walk, "reference_ps": (place - 60.0, place + 60.0)})


class Bound:
    """The Cramer-Rao bound of the simulated radar."""

    def __init__(self) -> None:
        self.settings = SimulationSettings()
        self.receiver = Receiver(self.settings)
        self.laser = Transmitter(self.settings).pulse(OPERATING_V, OPERATING_DEGC)
        self._shape = lru_cache(maxsize=64)(self._make_shape)

    def _make_shape(self, response_mv: float) -> tuple[CubicSpline, float, float, float]:
        """The pulse at a response, where it crosses half of its peak, and its extent."""
        charge = self.receiver.reference_charge_fc(response_mv / self.settings.reference_response_mv)
        for _ in range(40):
            (pulse,) = self.receiver.pulses(np.zeros(1), np.array([charge]), self.laser.fwhm_ps)
            charge *= response_mv / pulse.response_mv
        place = pulse.begin_ps + TABLE_PS * np.arange(len(pulse.shape))
        spline = CubicSpline(place[::16], pulse.shape[::16].astype(np.float64))
        before = int(np.argmax(pulse.shape >= pulse.response_mv / 2))
        half = float(
            np.interp(pulse.response_mv / 2, pulse.shape[before - 1 : before + 1], place[before - 1 : before + 1])
        )
        return spline, half, float(place[0]), float(place[-17])

    def pulse(self, time_ps: float, response_mv: float) -> Pulse:
        def signal(after_ps: FloatArray, amplitude_mv: float) -> FloatArray:
            spline, own_half_ps, first, last = self._shape(amplitude_mv)
            at = after_ps + own_half_ps
            return np.where((at > first) & (at < last), spline(np.clip(at, first, last)), 0.0)

        return Pulse(signal, time_ps, response_mv)

    def variance(self, signal_mv: FloatArray, slope: FloatArray) -> FloatArray:
        signal = np.maximum(signal_mv, 0.0)
        quantised = self.settings.mv_per_code**2 / 12
        laser = self.receiver.shot_noise_mv * signal + (self.laser.energy_noise * signal) ** 2
        return self.receiver.dark_noise_mv**2 + quantised + laser + (self.settings.trigger_jitter_ps * slope) ** 2

    def sd_mm(self, ranges: Ranges, response_mv: float, sweeps: int) -> float:
        start, stop = float(np.nanmedian(ranges.reference_ps)), float(np.nanmedian(ranges.echo_ps))
        reference = self.pulse(start, self.settings.reference_response_mv)
        return float(
            np.sqrt(range_bound_mm2(reference, self.pulse(stop, response_mv), TIMES_PS, self.variance, sweeps))
        )


def efficiency(seed: int, count: int, picture: Path | None) -> None:
    """Print, and draw, variance over bound, and variance over the variance told, for responses and averages."""
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
        told = np.mean(fitted**2 / found["template"].variance_mm2)
        print(
            f"{response:6.0f} {sweeps:8d} {best:12.4f} | {crossing.std():16.3f} {ratio[0]:14.1f} |"
            f" {fitted.std():15.4f} {ratio[1]:10.2f} {told:7.2f}"
        )
    if picture:
        draw(ratios, picture)


def draw(ratios: FloatArray, picture: Path) -> None:
    """Draw variance over bound against response, one line for each number of averages."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, style, of_method in zip(METHODS, ("--", "-"), ratios, strict=True):
        for colour, sweeps, values in zip(("C0", "C1", "C2", "C3"), AVERAGES, of_method, strict=True):
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
    print("response |  half-maximum: before  after |  template: before  after  told sd | standard error")
    for response in HELD_BACK_MV:
        bench = painted(seed + 77, response, target="plate", distance_mm=DISTANCE_MM)
        traces, true = readings(bench, count, SWEEPS)
        row, told, error = [], 0.0, 0.0
        for method in METHODS:
            for with_calibration in (bare, calibration):
                found = estimate(traces, TIMES_PS, method=method, calibration=with_calibration, sweeps=SWEEPS)
                row.append(float(np.mean(found.range_mm - true)))
            told, error = float(found.bias_sd_mm.mean()), float(found.range_mm.std() / np.sqrt(count))
        print(
            f"{response:8.1f} | {row[0]:20.3f} {row[1]:6.3f} | {row[2]:17.3f} {row[3]:6.3f} {told:8.3f} | {error:.3f}"
        )


class WindowedRadar:
    """Takes places of a raster window by window from the simulated optics."""

    def __init__(self, seed: int, target: str) -> None:
        self.bench = Bench(seed, target=target, distance_mm=900.0)
        self.number = 0

    def look(self, place: Place) -> tuple[tuple[FloatArray, FloatArray], float]:
        """Return the two traces (mV) and the true range (mm)."""
        self.number += 1
        bench, traces = self.bench, []
        for k, window in enumerate((place.reference, place.echo)):
            key = (self.number, 0, 0, k)
            wanted = Acquisition(
                key, bench.clock.now(), PRF_HZ, window.start_ps, window.step_ps, window.samples, window.sweeps,
                SETTLE_SHOTS, True,
            )  # fmt: skip
            sums = bench.optics.acquire(wanted)
            traces.append((sums / window.sweeps - bench.settings.code_of_zero) * bench.settings.mv_per_code)
        return (traces[0], traces[1]), bench.optics.truth[self.number, 0, 0].range_mm


class WindowedScan:
    """A planned 40 x 40 scan at 1 mm and 90 cm, and the same places with whole traces.

    Attributes
    ----------
    ranges, swept : Ranges
    true_mm : (1600,) float array
        Along the axis of the beam; inf where only the rim of the spot meets the target.
    shots, retaken : int
    """

    def __init__(self, seed: int, target: str, wanted_mm: float) -> None:
        self.calibration = calibrate(1000 * seed)
        self.radar = WindowedRadar(seed, target)
        raster = Raster(rows=SIZE, columns=SIZE, step_mm=1.0, distance_mm=900.0)
        planner = WindowPlanner(self.calibration, SIZE, PlanSettings(wanted_sd_mm=wanted_mm, settle_shots=SETTLE_SHOTS))
        self.shots = self.retaken = 0
        lines, true, swept = [], [], []
        for row in range(SIZE):
            codes = raster.line(row).codes
            places = planner.line()
            ranges, true_mm = self._take(codes, places)
            again = planner.lost(places, ranges)
            if len(again):
                ranges = with_retaken(ranges, again, self._take(codes[again], planner.wide(again))[0])
                self.retaken += len(again)
            planner.learn(ranges)
            lines.append(ranges)
            true.append(true_mm)
            swept.append(self._sweep(codes))
        self.ranges, self.swept, self.true_mm = Ranges.joined(lines), Ranges.joined(swept), np.concatenate(true)

    def _take(self, codes: NDArray[np.int64], places: list[Place]) -> tuple[Ranges, FloatArray]:
        traces, true = [], []
        for code, place in zip(codes, places, strict=True):
            _aim(self.radar.bench, code)
            seen, range_mm = self.radar.look(place)
            traces.append(seen)
            true.append(range_mm)
        self.shots += sum(place.shots(SETTLE_SHOTS) for place in places)
        return estimate_places(places, traces, calibration=self.calibration, shared_reference=True), np.array(true)

    def _sweep(self, codes: NDArray[np.int64]) -> Ranges:
        traces = []
        for code in codes:
            _aim(self.radar.bench, code)
            traces.append(self.radar.bench.take()[0])
        return estimate(np.stack(traces), TIMES_PS, method="half-maximum", calibration=self.calibration, sweeps=SWEEPS)


def windows(seed: int, target: str, wanted_mm: float) -> None:
    """Print what a planned scan costs and how good it is."""
    scan = WindowedScan(seed, target, wanted_mm)
    ranges, places = scan.ranges, SIZE * SIZE
    have, had = np.isfinite(ranges.range_mm), np.isfinite(scan.swept.range_mm)
    suspect = (ranges.flags & np.uint16(SUSPECT)) != 0
    response = np.nanpercentile(ranges.response_mv, [1, 50, 99]).round(1).tolist()
    print(
        f"{target}: {have.sum()} points, {100 * (have & had).sum() / had.sum():.2f} % of the {had.sum()} of sweep mode"
    )
    print(f"  taken again {scan.retaken}, suspect {suspect.sum()}, response (1, 50, 99 % of the points) {response} mV")
    light_s = scan.shots / PRF_HZ
    mirrors_s = (places + scan.retaken) * STEP_SETTLE_S + SIZE * FLYBACK_S
    print(
        f"  {scan.shots / places:.0f} shots a point: {light_s:.2f} s at 80 kHz, {scan.shots / 240e3:.2f} s at 240 kHz"
    )
    print(
        f"  with mirrors, {1e3 * STEP_SETTLE_S:g} ms a place and {1e3 * FLYBACK_S:g} ms a line: "
        f"{light_s + mirrors_s:.2f} s, "
        f"{1 + mirrors_s / light_s:.2f} of the shots alone"
    )
    on_axis = np.isfinite(scan.true_mm)
    for name, chosen in (("window", have & on_axis), ("window, not suspect", have & on_axis & ~suspect)):
        _print_error(name, (ranges.range_mm - scan.true_mm)[chosen], ranges.variance_mm2[chosen])
    chosen = had & on_axis
    _print_error("sweep, half-maximum", (scan.swept.range_mm - scan.true_mm)[chosen], scan.swept.variance_mm2[chosen])


def _print_error(name: str, error: FloatArray, variance: FloatArray) -> None:
    print(
        f"  {name:22} rms {np.sqrt(np.mean(error**2)):.3f} mm, bias {error.mean():6.3f} mm, "
        f"largest {np.abs(error).max():.3f} mm, chi^2 {np.mean(error**2 / variance):.2f}"
    )


def _aim(bench: Bench, code: NDArray[np.int64]) -> None:
    angles = np.deg2rad(bench.settings.field_deg) * (code - CENTRE_CODE) / (2 * CENTRE_CODE)
    bench.aim(float(angles[0]), float(angles[1]))


def throughput(seed: int) -> None:
    """Print records a second of processor time, on one core."""
    calibration = calibrate(1000 * seed, 40)
    traces, _ = readings(painted(seed, 45.0, target="plate", distance_mm=DISTANCE_MM), 500, 1)
    traces = np.tile(traces, (4, 1))
    found = estimate(traces, TIMES_PS, method="template", calibration=calibration)
    pieces = []
    for place in (found.reference_ps, found.echo_ps):
        first = int((np.median(place) - 260.0 - TIMES_PS[0]) / 6.7)
        pieces.append(WindowTraces.of(np.tile(traces[:, first : first + 96], (5, 1)), TIMES_PS[first], 6.7))
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
        ("template, 2 x 96 samples", lambda: estimate_windows(*pieces, calibration=calibration), 10_000),
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
    parser.add_argument("what", choices=("efficiency", "walk", "windows", "throughput"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--readings", type=int)
    parser.add_argument("--picture", type=Path, help="efficiency: draw into this file")
    parser.add_argument("--target", default="hip")
    parser.add_argument("--wanted-mm", type=float, default=0.2)
    given = parser.parse_args()
    if given.what == "efficiency":
        efficiency(given.seed, given.readings or 1000, given.picture)
    elif given.what == "walk":
        walk(given.seed, given.readings or 200)
    elif given.what == "windows":
        windows(given.seed, given.target, given.wanted_mm)
    else:
        throughput(given.seed)


if __name__ == "__main__":
    main()
