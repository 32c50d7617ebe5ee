"""CPU time and peak memory of one registration, 1 000 to 1 000 000 points; writes docs/registration.md.

python benchmarks/registration/scaling.py            # a few minutes; each size in a process of its own
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first

NAME = "benchmarks/registration/scaling.py"
SIZES = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
SCANS = 3
TISSUE = 0.3


def peak_mb() -> float:
    """Highest resident memory of this process so far (Linux); getrusage would count the parent's, too."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def child(file: str) -> None:
    """Register one scan after the model is prepared, twice; print CPU ms, errors and peak memory as JSON."""
    from picoradar.registration import load_model, pose_error, register
    from picoradar.sim.physics import HIP_FILE, SOCKET_CENTRE_MM

    model = load_model(HIP_FILE)
    data = np.load(file)
    points, grid, truth = data["points"], data["grid"], data["truth"]
    before_mb = peak_mb()
    times = []
    for _ in range(2):  # the first also pays for what is made once
        began = time.process_time()
        found = register(points, model, grid=grid)
        times.append((time.process_time() - began) * 1e3)
        error = pose_error(found.model_from_scanner, truth, np.array(SOCKET_CENTRE_MM))
        del found  # the memory is that of one registration
    print(json.dumps([min(times), before_mb, peak_mb(), error.rotation_deg, error.translation_mm]))


def measured(size: int, folder: Path) -> np.ndarray:
    """Rows (SCANS, 5) of what the children print."""
    import synthetic_scans as synthetic

    from picoradar.registration import load_model
    from picoradar.sim.physics import HIP_FILE, SOCKET_AXIS, SOCKET_CENTRE_MM

    model = load_model(HIP_FILE)
    step = np.sqrt(np.pi * synthetic.WINDOW_MM**2 * synthetic.COVERAGE / size)
    rows = []
    for seed in range(SCANS):
        scan = synthetic.scan(
            model, np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS), seed, tissue=TISSUE, step_mm=float(step)
        )
        file = folder / "scan.npz"
        np.savez(file, points=scan.points, grid=scan.grid, truth=scan.truth)
        out = subprocess.run(
            [sys.executable, __file__, "--child", str(file)], capture_output=True, text=True, check=True
        )
        rows.append([len(scan.points), *json.loads(out.stdout)])
        print(rows[-1], flush=True)
    return np.array(rows)


def main() -> None:
    from marked import provenance, write_between_marks

    lines = [
        "| points | CPU ms | us a point | memory before, MB | peak, MB | worst rotation, deg | worst shift, mm |",
        "|---|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for size in SIZES:
            rows = measured(size, Path(folder))
            count, ms, before = np.median(rows[:, :3], axis=0)
            lines.append(
                f"| {count:.0f} | {ms:.0f} | {1e3 * ms / count:.1f} | {before:.0f} | {rows[:, 3].max():.0f} "
                f"| {rows[:, 4].max():.3f} | {rows[:, 5].max():.3f} |"
            )
            print(lines[-1], flush=True)
    note = (
        f"{provenance()} {SCANS} scans a size of the shipped hip bone, {TISSUE:.0%} of it under tissue, from anywhere."
    )
    write_between_marks("registration.md", NAME, [note, "", *lines])


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2])
    else:
        main()
