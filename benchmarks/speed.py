"""CPU time of a checkout against an earlier one: registration, preparation of a model, a scan, ``--help``.

    python benchmarks/digests.py scans scans/     # once: the scans that are registered
    python benchmarks/speed.py ../before . scans/ --pairs 20

The two run in turn, A B A B ..., one thread each, so that a machine whose speed drifts slows down both alike. Printed
is the median of the ratios after / before with the upper end of its 95 % interval (bootstrap over the pairs).
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RESAMPLED = 4000
"""Bootstrap samples of the pairs."""

REGISTERED = 12
"""Stored scans that one run registers."""

WORKER = """
import sys, time, os
from pathlib import Path
import numpy as np
try:
    from picoradar import registration as r
except ImportError:  # version 0.1
    import registration as r
folder, what, count = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
if what == "preparation":
    import trimesh
    mesh = trimesh.load_mesh(folder / "model.stl")
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    began = time.process_time()
    r.prepare_model(vertices, faces)
    print(time.process_time() - began)
else:
    model = r.load_model(folder / "model.stl")
    files = sorted(folder.glob("*.csv"))
    tables = [np.loadtxt(f, delimiter=",", skiprows=1) for f in files[:: len(files) // count]]
    r.register(tables[0][:, :3], model)
    began = time.process_time()
    for table in tables:
        r.register(table[:, :3], model, grid=table[:, 3:].astype(int))
    print((time.process_time() - began) / len(tables))
"""


def python_of(checkout: Path) -> Path:
    return checkout / ".venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def worker_s(checkout: Path, scans: Path, what: str, cache: str) -> float:
    """CPU seconds that the worker reports."""
    line = [str(python_of(checkout)), "-c", WORKER, str(scans), what, str(REGISTERED)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PICORADAR_CACHE": cache}
    return float(subprocess.run(line, env=environment, capture_output=True, text=True, check=True, cwd=cache).stdout)


def command_s(checkout: Path, *arguments: str) -> float:
    """CPU seconds of a whole command."""
    command = python_of(checkout).parent / "picoradar"
    before = os.times()
    subprocess.run(
        [str(command), *arguments], env={**os.environ, "OMP_NUM_THREADS": "1"}, capture_output=True, check=True
    )
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def measured_s(job: str, checkout: Path, scans: Path) -> float:
    """CPU seconds of one run of a job."""
    with tempfile.TemporaryDirectory() as folder:
        if job in ("registration", "preparation"):
            return worker_s(checkout, scans, job, folder)
        if job == "scan":
            return command_s(checkout, "scan", "--grid", "40x40", "--seed", "3", "-o", f"{folder}/scan.db")
        if job == "window scan":
            options = ("--mode", "window", "--grid", "40x40", "--seed", "3")
            return command_s(checkout, "scan", *options, "-o", f"{folder}/scan.db")
        return command_s(checkout, "--help")


def upper_bound(ratios: list[float]) -> float:
    """Upper end of the 95 % bootstrap interval of the median."""
    draw = random.Random(1)
    medians = sorted(statistics.median(draw.choices(ratios, k=len(ratios))) for _ in range(RESAMPLED))
    return medians[int(0.975 * RESAMPLED)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("scans", type=Path)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--jobs", default="registration,preparation,scan,window scan,--help")
    options = parser.parse_args()
    before, after, scans = (path.resolve() for path in (options.before, options.after, options.scans))
    print("| job | before, CPU s | after, CPU s | ratio, median | upper 95 % bound |\n|---|---|---|---|---|")
    for job in options.jobs.split(","):
        pairs, began = [], time.monotonic()
        for k in range(options.pairs):
            pairs.append((measured_s(job, before, scans), measured_s(job, after, scans)))
            left_s = (time.monotonic() - began) / (k + 1) * (options.pairs - k - 1)
            print(f"\r{job}: {k + 1} of {options.pairs} pairs, {left_s:.0f} s left ", end="", file=sys.stderr)
        print(file=sys.stderr)
        ratios = [new / old for old, new in pairs]
        old, new = (statistics.median(column) for column in zip(*pairs, strict=True))
        row = f"| {job} | {old:.3f} | {new:.3f} | {statistics.median(ratios):.3f} | {upper_bound(ratios):.3f} |"
        print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
