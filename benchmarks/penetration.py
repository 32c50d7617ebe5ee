"""Whether the range error that is stated on bone is true, on bones that were not measured.

    python benchmarks/penetration.py [--samples 20] [--scans 10] [--processes 1] [--mode window]

In the second world (``world = "clinic"``), calibrated on paint: for each sample of bone, `bench penetration` measures
*another* sample, whose optical coefficients differ by 20 %; then the hip made of the first one is scanned in several
poses and registered. The true error at the targets (the middle of the socket and three places on its rim) is compared
with what was stated there, p95 and two standard deviations of the common range error. The same points are registered
with the bias put back and not corrected by the form of their echoes: what the radar would have said without the
procedure.

Exit status 1 when fewer than 92 % of the true errors lie inside, the median of what is stated is above 2.5 times the
root mean square of the true errors, the procedure makes them smaller by less than a factor of 3, or a registration
without it passes.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import structlog
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, points_from, true_angles
from picoradar.instrument.cli import scanning, session
from picoradar.instrument.cli.stages import SimulatedStage
from picoradar.instrument.procedures.penetration import procedure as penetration
from picoradar.instrument.procedures.station import Radar, Station
from picoradar.instrument.recording import Cloud, Recording
from picoradar.instrument.settings import Settings, override
from picoradar.registration import Model, Registration, prepare_model, register
from picoradar.sim.physics.targets import SOCKET_CENTRE_MM

structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.WARNING))

MEASURED, CALIBRATING = 10_000, 500_000  # number of the piece beside a sample, and seed of the bench it is measured on
LEAST_INSIDE, LARGEST_RATIO, LEAST_GAIN = 0.92, 2.5, 3.0


@dataclass(frozen=True)
class Scanned:
    """One scan of one sample: true and stated error (T,) at its targets, true error without correction, the standard
    deviation of the range error that was stated, its true mean, and the verdicts with the procedure and without."""

    sample: int
    true_mm: NDArray[np.float64]
    stated_mm: NDArray[np.float64]
    uncorrected_mm: NDArray[np.float64]
    range_sd_mm: float
    range_error_mm: float
    verdict: str
    verdict_without: str


def settings_of(seed: int, sample: int, mode: str = "sweep") -> Settings:
    """Make the settings of a bench of the second world with one sample of bone."""
    return override(
        Settings(),
        {
            "": {"seed": seed},
            "scan": {"mode": mode, "material": "bone"},
            "simulation": {"world": "clinic", "tissue_sample": sample},
        },
    )


def measured_on(sample: int, paint: Calibration) -> Calibration:
    """Return the calibration with `bench penetration` done on a sample."""
    settings = settings_of(CALIBRATING + sample, sample)
    with tempfile.TemporaryDirectory() as folder, session.session(settings, None, calibration=paint) as run:
        session.warm_up(run)
        radar = Radar(run.controller, run.settings, run.calibration, run.identities)
        station = Station(radar, SimulatedStage(run.simulated), Path(folder), lambda *_: None)
        outcome = penetration.run(station)
    if outcome.calibration is None:
        raise SystemExit(f"sample {sample}: bench penetration did not pass: {' '.join(outcome.findings)}")
    return outcome.calibration


def scans_of(sample: int, scans: int, mode: str) -> list[Scanned]:
    """Measure another sample, then scan this one and register it."""
    with session.resources.as_file(session.shipped_calibration(settings_of(1, sample))) as file:
        paint = Calibration.load(file).model_copy(update={"materials": {}})
    calibration = measured_on(MEASURED + sample, paint)
    return [one_scan(1000 * sample + number, sample, mode, calibration) for number in range(scans)]


def one_scan(seed: int, sample: int, mode: str, calibration: Calibration) -> Scanned:
    """Scan one sample in one pose, register it, and compare with the truth."""
    settings = settings_of(seed, sample, mode)
    with tempfile.TemporaryDirectory() as folder, session.session(settings, None, calibration=calibration) as run:
        session.warm_up(run)
        described, _, cloud = scanning.record_scan(run, Path(folder) / "scan.db")
        with Recording.open(Path(folder) / "scan.db") as recording:
            of_lines = np.concatenate([line.range_mm for line in recording.lines(traces=False)])
        landmarks, truth, model = run.simulated.landmarks(), run.simulated.model_from_scanner, run.simulated.model
    prepared = prepare_model(*model)
    error, raw_mm, cloud = described["range_error"], of_lines[cloud.has_range], cloud.with_range()
    raw_mm = raw_mm + error["bias_mm"]
    targets = np.array([SOCKET_CENTRE_MM, *(pair["model"] for pair in landmarks)])
    found = registered(cloud, cloud.points_mm, prepared, landmarks, targets, error["sd_mm"])
    without = registered(cloud, with_ranges(cloud, raw_mm, calibration), prepared, landmarks, targets, None)
    return Scanned(
        sample=sample,
        true_mm=at_targets(found, truth, targets),
        stated_mm=np.array([target.stated_mm for target in found.targets]),
        uncorrected_mm=at_targets(without, truth, targets),
        range_sd_mm=error["sd_mm"],
        range_error_mm=described["truth"]["range_bias_mm"],
        verdict=found.verdict,
        verdict_without=without.verdict,
    )


def with_ranges(cloud: Cloud, range_mm: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Return the points (N, 3) with other ranges (N,)."""
    angles = true_angles(cloud.angles_rad, calibration.scanner)
    return points_from(angles, range_mm, calibration.mirror_separation_mm)


def registered(
    cloud: Cloud,
    points_mm: NDArray[np.float64],
    model: Model,
    landmarks: list[dict[str, object]],
    targets_mm: NDArray[np.float64],
    range_sd_mm: float | None,
) -> Registration:
    """Register from clicked landmarks, as the demo does."""
    return register(
        points_mm,
        model,
        start=landmarks,
        covariance=cloud.covariance_mm2,
        response_mv=cloud.response_mv,
        grid=cloud.grid,
        targets=targets_mm,
        range_bias_mm=range_sd_mm,
    )


def at_targets(found: Registration, truth: NDArray[np.float64], targets_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far each target (T, 3) really is from where the registration puts it, mm."""
    moved = found.model_from_scanner @ np.linalg.inv(truth)
    return np.linalg.norm(targets_mm @ moved[:3, :3].T + moved[:3, 3] - targets_mm, axis=1)


def show(done: list[Scanned]) -> bool:
    """Print the table; get whether everything asked for holds."""
    true, stated, raw = (
        np.array([getattr(one, name) for one in done]) for name in ("true_mm", "stated_mm", "uncorrected_mm")
    )
    print(f"{'target':>16} {'inside':>7} {'median stated':>14} {'true rms':>9} {'ratio':>6} {'without':>8} {'gain':>6}")
    names = ["middle of socket", *(f"rim {number}" for number in range(1, true.shape[1])), "all"]
    holds = True
    for number, name in enumerate(names):
        chosen = slice(None) if name == "all" else slice(number, number + 1)
        t, s, u = (values[:, chosen] for values in (true, stated, raw))
        rms, rms_without = np.sqrt(np.mean(t**2)), np.sqrt(np.mean(u**2))
        inside, ratio, gain = float(np.mean(t <= s)), float(np.median(s) / rms), float(rms_without / rms)
        row = f"{name:>16} {inside:7.1%} {np.median(s):11.3f} mm {rms:6.3f} mm {ratio:6.2f}"
        print(f"{row} {rms_without:5.2f} mm {gain:6.1f}")
        if name == "all":
            holds = inside >= LEAST_INSIDE and ratio <= LARGEST_RATIO and gain >= LEAST_GAIN
    every = float(np.mean((true <= stated).all(axis=1)))
    error, sd = np.array([one.range_error_mm for one in done]), np.array([one.range_sd_mm for one in done])
    print(f"{len(done)} scans, all targets inside: {every:.1%}")
    print(f"common range error left: rms {np.sqrt(np.mean(error**2)):.3f} mm, stated SD {np.median(sd):.3f} mm")
    words = {word: sum(one.verdict == word for one in done) for word in ("pass", "caution", "fail")}
    without = {word: sum(one.verdict_without == word for one in done) for word in words}
    print(f"verdicts {words}; without the procedure {without}")
    return holds and every >= LEAST_INSIDE and without["pass"] == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=20)
    parser.add_argument("--scans", type=int, default=10, help="of each sample")
    parser.add_argument("--mode", default="window", choices=("window", "sweep"))
    parser.add_argument("--processes", type=int, default=1)
    asked = parser.parse_args()
    one = partial(scans_of, scans=asked.scans, mode=asked.mode)
    done: list[Scanned] = []
    holds = False
    try:
        with ProcessPoolExecutor(asked.processes) as pool:
            for found in pool.map(one, range(1, asked.samples + 1)):
                done += found
                left = [round(scanned.range_error_mm, 2) for scanned in found]
                print(f"sample {found[0].sample}: range error {left}", flush=True)
    finally:
        if done:
            holds = show(done)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
