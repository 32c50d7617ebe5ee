"""How fast the simulated light is, beside numpy's own speed for drawing as many Gaussian numbers.

    python benchmarks/simulation.py [--grid 40x40] [--repeat 3] [--memory] [--worlds]

Scans a grid over the hip socket with full traces (8 sweeps of 1430 samples) on one core, without firmware, links or
ranging, line by line as the instrument reads it, and beside it how much longer it takes with light that enters the
tissue. The floor is one Gaussian number in single precision for each sample. With ``--memory`` the peak memory of the
process is reported for grids of several sizes. With ``--worlds`` the processor time of the clinic's world over that of
the dissertation's is reported, for full traces and for a whole scan in windows.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from picoradar.instrument.cli.main import run
from picoradar.instrument.cli.simulated import checked_simulation
from picoradar.instrument.settings import Settings, to_toml
from picoradar.sim.physics import Noise, bundle
from picoradar.sim.validation import SAMPLES, SWEEPS, Bench
from picoradar.sim.worlds import WORLDS

DISTANCE_MM = 900.0
SEED = 2004
DEVICE_S_A_POINT = 0.143
WINDOW_SAMPLES = 200  # of both windows of a record together, about


def scan_s(columns: int, rows: int, samples: int = SAMPLES, **changes: object) -> float:
    """Take every record of a raster at 1 mm; seconds of processor time in `Optics.acquire` and the mirrors."""
    bench = Bench(SEED, target="hip", distance_mm=DISTANCE_MM, **changes)
    bench.take(samples=samples)
    begin = time.process_time()
    for row in range(rows):
        for column in range(columns):
            bench.aim((column - columns / 2) / DISTANCE_MM, (row - rows / 2) / DISTANCE_MM)
            bench.take(samples=samples)
    return time.process_time() - begin


def window_scan_s(columns: int, rows: int, world: str) -> float:
    """Scan the grid in windows with the whole instrument; seconds of processor time."""
    settings = Settings.model_validate(
        {
            "seed": SEED,
            "scan": {"mode": "window", "columns": columns, "rows": rows},
            "simulation": {"target": "hip", "world": world},
        }
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "settings.toml"
        path.write_text(to_toml(settings, checked_simulation(settings)), encoding="utf-8")
        begin = time.process_time()
        with contextlib.redirect_stdout(io.StringIO()):
            status = run(["scan", "--settings", str(path), "-o", str(Path(folder) / "scan.db"), "--json"])
        if status != 0:
            raise RuntimeError(f"the scan of world {world} ended with status {status}")
        return time.process_time() - begin


def tissue_light_times(columns: int, rows: int, samples: int, repeat: int) -> float:
    """Processor time of the same raster with light in tissue, over that without; the least of several each."""
    off, on = (
        min(scan_s(columns, rows, samples, tissue_light=light) for _ in range(repeat)) for light in (False, True)
    )
    return round(on / off, 2)


def rays_s(columns: int, rows: int) -> float:
    """Cast the rays of the same raster alone."""
    bench = Bench(SEED, target="hip", distance_mm=DISTANCE_MM)
    beam = bench.ideal_beam(0.0, 0.0)
    origins = bundle(beam.origin, beam.direction, bench.settings.spot_diameter_mm)
    directions = np.repeat(beam.direction[None], len(origins), axis=0)
    begin = time.process_time()
    for _ in range(columns * rows):
        bench.scene.cast(origins, directions)
    return time.process_time() - begin


def floor_s(columns: int, rows: int) -> float:
    """Draw one Gaussian number for each sample, from one stream."""
    rng = Noise(SEED).stream("floor")
    numbers = np.empty((SWEEPS, SAMPLES), dtype=np.float32)
    begin = time.process_time()
    for _ in range(columns * rows):
        rng.standard_normal(out=numbers, dtype=np.float32)
    return time.process_time() - begin


def peak_memory_mb() -> float:
    """Peak resident memory of this process (Linux); getrusage would count that of the process that started it."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return round(int(status.split("VmHWM:")[1].split()[0]) / 1024, 1)


def memory_mb(grid: str) -> float:
    """Peak memory of a process of its own that scans a grid."""
    ran = subprocess.run(
        [sys.executable, __file__, "--grid", grid, "--repeat", "1"], check=True, capture_output=True, text=True
    )
    return float(json.loads(ran.stdout)["peak_memory_mb"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", default="40x40")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--worlds", action="store_true")
    asked = parser.parse_args()
    columns, rows = (int(part) for part in asked.grid.split("x"))

    scan, rays, floor = (
        min(measure(columns, rows) for _ in range(asked.repeat)) for measure in (scan_s, rays_s, floor_s)
    )
    samples = columns * rows * SWEEPS * SAMPLES
    result = {
        "grid": asked.grid,
        "samples": samples,
        "scan_s": round(scan, 3),
        "samples_per_s": round(samples / scan),
        "gaussian_floor_s": round(floor, 3),
        "times_floor": round(scan / floor, 2),
        "ray_casting_share": round(rays / scan, 3),
        "faster_than_device": round(columns * rows * DEVICE_S_A_POINT / scan),
        "tissue_light_times": tissue_light_times(columns, rows, SAMPLES, asked.repeat),
        "tissue_light_times_in_windows": tissue_light_times(columns, rows, WINDOW_SAMPLES, asked.repeat),
        "peak_memory_mb": peak_memory_mb(),
    }
    if asked.memory:
        result["peak_memory_mb_by_grid"] = {grid: memory_mb(grid) for grid in ("10x10", "40x40", "110x110")}
    if asked.worlds:
        for name, measure in (("full_traces", scan_s), ("window_scan", window_scan_s)):
            pairs = [[measure(columns, rows, world=w) for w in WORLDS] for _ in range(asked.repeat)]
            off, on = np.min(pairs, axis=0)
            result[f"clinic_{name}"] = {"off_s": round(off, 2), "on_s": round(on, 2), "ratio": round(on / off, 3)}
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
