"""Live registration on the simulated bench: how soon a pose is good enough, how true it is, what a line costs.

python benchmarks/registration/live.py --seeds 10                  # hip socket in window mode, rows and interlaced
python benchmarks/registration/live.py --seeds 10 --world clinic
python benchmarks/registration/live.py --example 1                 # what is known after each line, beside the truth
python benchmarks/registration/live.py --synthetic 60              # wrong ends, under tissue, without an instrument

Each scan is registered to the bare bone from anywhere while it is made. First it ends by itself: device time from
laser on to the verdict, errors stated and true at the socket's centre. Then all its lines are taken: CPU time of a line
against that of a batch registration of the whole scan in the same process, and how far the last followed pose and the
confirmed one are from the batch pose, in its standard deviations.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
from bench_scans import structlog  # noqa: E402 - quiet
from synthetic_scans import scan as synthetic_scan  # noqa: E402

from picoradar.instrument.acquisition.order import LineOrder  # noqa: E402
from picoradar.instrument.cli import scanning, session  # noqa: E402
from picoradar.instrument.cli.following import Asked  # noqa: E402
from picoradar.instrument.recording import Recording  # noqa: E402
from picoradar.instrument.settings import Settings, override  # noqa: E402
from picoradar.registration import Model, Registration, pose_error, prepare_model, register  # noqa: E402
from picoradar.registration.live import Line, LiveRegistration  # noqa: E402
from picoradar.registration.se3 import inverse, transform, vector_from_rotation  # noqa: E402
from picoradar.sim.physics import SOCKET_AXIS, SOCKET_CENTRE_MM, hip  # noqa: E402

TISSUE_SHARES = (0.0, 0.3, 0.6)
"""Shares of the socket that clumps of tissue cover."""

BATCHES = 5
"""Batch registrations whose median time counts."""

TARGETS = [{"name": "socket centre", "position": list(SOCKET_CENTRE_MM)}]
_ = structlog


def settings_of(seed: int, order: str, world: str) -> Settings:
    """Settings of a scan of the hip in window mode."""
    scan = {"mode": "window", "material": "bone", "order": order}
    return override(Settings(), {"": {"seed": seed}, "scan": scan, "simulation": {"world": world}})


def scan(seed: int, order: str, world: str, model: Model | None) -> tuple[dict[str, Any], list[Any], np.ndarray]:
    """Scan the hip, registered meanwhile if a model is given: what the command describes, lines, true pose."""
    asked = None if model is None else Asked(model, {"targets": TARGETS}, until_tre_mm=0.3)
    with tempfile.TemporaryDirectory() as folder, session.session(settings_of(seed, order, world), None) as run:
        session.warm_up(run)
        path = Path(folder) / "scan.db"
        described = scanning.record_scan(run, path, asked).described
        with Recording.open(path) as recording:
            lines = sorted(recording.lines(traces=False), key=lambda line: line.device_time_s)
        return described, lines, run.simulated.model_from_scanner


def distance_sd(one: Registration, other: Registration) -> float:
    """Distance of two poses in standard deviations of the second (Mahalanobis)."""
    motion = one.model_from_scanner @ inverse(other.model_from_scanner)
    shift = transform(motion, other.centre[None])[0] - other.centre
    x = np.concatenate([vector_from_rotation(motion[:3, :3]), shift])
    return float(np.sqrt(x @ np.linalg.solve(other.covariance, x)))


def followed(lines: list[Any], model: Model, range_bias_mm: float) -> dict[str, float]:
    """CPU times of lines and of batch registrations, ms, and distances of the poses, SD."""
    live = LiveRegistration(model, targets=TARGETS, range_bias_mm=range_bias_mm)
    cost: list[float] = []
    for line in lines:
        stood, began = live.result.registration is not None, time.process_time()
        live.add(line)
        if stood:
            cost.append((time.process_time() - began) * 1e3)
    last, searches = live.result.registration, live.result.searches
    final = live.confirm().registration
    if last is None or final is None:
        raise SystemExit(f"no pose: {live.result.why}")
    points, covariance, response, grid = (
        np.concatenate([np.asarray(part)[line.has_range] for line, part in zip(lines, parts, strict=True)])
        for parts in (
            [line.points_mm for line in lines],
            [line.covariance_mm2 for line in lines],
            [line.response_mv for line in lines],
            [np.column_stack([np.full(len(line.columns), line.index), line.columns]) for line in lines],
        )
    )
    batch_ms = []
    for _ in range(BATCHES):
        began = time.process_time()
        batch = register(
            points, model, covariance=covariance, response_mv=response, grid=grid, targets=TARGETS,
            range_bias_mm=range_bias_mm,
        )  # fmt: skip
        batch_ms.append((time.process_time() - began) * 1e3)
    return {
        "points": len(points), "batch_ms": float(np.median(batch_ms)), "mean_ms": float(np.mean(cost)),
        "median_ms": float(np.median(cost)), "p90_ms": float(np.quantile(cost, 0.9)), "largest_ms": max(cost),
        "searches": searches, "last_sd": distance_sd(last, batch), "final_sd": distance_sd(final, batch),
    }  # fmt: skip


def synthetic(count: int) -> None:
    """Print how many scans by ray casting end by themselves, and how many of these ends are wrong."""
    model, centre = prepare_model(hip().vertices, hip().faces), np.array(SOCKET_CENTRE_MM)
    for tissue in TISSUE_SHARES:
        for order in ("rows", "interlaced"):
            shares, turns, wrong = [], [], 0
            for seed in range(count):
                made = synthetic_scan(model, centre, np.array(SOCKET_AXIS), seed, tissue=tissue)
                live = LiveRegistration(model, targets=TARGETS, range_bias_mm=0.13)
                grid = made.grid - made.grid.min(axis=0)
                for row in LineOrder(int(grid[:, 0].max()) + 1, order).lines:
                    on = grid[:, 0] == row
                    live.add(Line(row, grid[on, 1], made.points[on]))
                    if live.reaches(0.3):
                        found = live.result
                        error = pose_error(found.model_from_scanner, made.truth, centre)
                        shares.append(found.points / len(grid))
                        turns.append(error.rotation_deg / found.registration.predicted_rotation_deg)
                        wrong += error.rotation_deg > 1.0 or error.translation_mm > 1.0
                        break
            rms = float(np.sqrt(np.mean(np.square(turns))))
            print(
                f"{tissue:.0%} tissue, {order}: {len(shares)} of {count} end, {wrong} wrong, after "
                f"{np.median(shares):.2f} of the points (median); rotation actual / predicted {rms:.2f} (rms)",
                flush=True,
            )


def example(seed: int, world: str) -> None:
    """Print what is known after each line of an interlaced scan."""
    model = prepare_model(hip().vertices, hip().faces)
    described, lines, truth = scan(seed, "interlaced", world, None)
    live = LiveRegistration(model, targets=TARGETS, range_bias_mm=described["range_error"]["sd_mm"])
    print("line  row  points  stage     verdict  rotation, deg    socket centre, mm")
    print("                                      predicted  true  predicted   true")
    for number, line in enumerate(lines, start=1):
        found = live.add(line)
        text = f"{number:4} {line.index:4} {live.result.points:7}  {live.result.stage:9}"
        if found is None:
            print(f"{text} {live.result.why}")
            continue
        error = pose_error(found.model_from_scanner, truth, np.array(SOCKET_CENTRE_MM))
        print(
            f"{text} {found.verdict:8} {found.predicted_rotation_deg:8.2f} {error.rotation_deg:6.2f}"
            f" {found.targets[0].rms_mm:9.3f} {error.translation_mm:7.3f}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=101)
    parser.add_argument("--world", default="dissertation")
    parser.add_argument("--example", type=int, help="seed of one scan, line by line")
    parser.add_argument("--synthetic", type=int, help="scans by ray casting, for each share of tissue and order")
    asked = parser.parse_args()
    if asked.synthetic is not None:
        synthetic(asked.synthetic)
        return
    if asked.example is not None:
        example(asked.example, asked.world)
        return
    model = prepare_model(hip().vertices, hip().faces)
    for order in ("rows", "interlaced"):
        ends, costs = [], []
        for seed in range(asked.first, asked.first + asked.seeds):
            end, sd_mm = ended(seed, order, asked.world, model)
            _, lines, _ = scan(seed, order, asked.world, None)
            cost = followed(lines, model, sd_mm)
            ends.append(end)
            costs.append(cost)
            print(f"{order:10} seed {seed}: " + ", ".join(f"{name} {value:.4g}" for name, value in end.items()))
            print(" " * 11 + ", ".join(f"{name} {value:.3g}" for name, value in cost.items()), flush=True)
        print(f"{order}, {len(ends)} scans: median / largest")
        for name, values in {name: [end[name] for end in ends] for name in ends[0]}.items():
            print(f"    {name}: {np.median(values):.3f} / {max(values):.3f}")
        for name in ("line over batch", "last_sd", "final_sd"):
            values = [cost["mean_ms"] / cost["batch_ms"] if "over" in name else cost[name] for cost in costs]
            print(f"    {name}: {np.median(values):.3f} / {max(values):.3f}")


def ended(seed: int, order: str, world: str, model: Model) -> tuple[dict[str, float], float]:
    """Describe a scan that ends by itself; and the deviation of the common range error that it knows, mm."""
    described, _, truth = scan(seed, order, world, model)
    found, target = described["registration"], described["registration"]["targets"][0]
    error = pose_error(np.array(found["model_from_scanner"]), truth, np.array(SOCKET_CENTRE_MM))
    reached_s = found["live"]["reached_after_s"]
    return {
        "end_s": np.inf if reached_s is None else reached_s,
        "pose_s": found["live"]["pose_after_s"],
        "lines": len(found["lines_used"]),
        "passes": float(found["verdict"] == "pass"),
        "predicted_mm": target["tre_mm"],
        "stated_mm": target["stated_mm"],
        "true_mm": error.translation_mm,
        "predicted_deg": found["predicted_rotation_deg"],
        "true_deg": error.rotation_deg,
    }, described["range_error"]["sd_mm"]


if __name__ == "__main__":
    main()
