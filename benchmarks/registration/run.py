"""Peers side by side on the same seeded scans; writes the tables into docs/benchmarks.md.

In an environment of its own::

    pip install -r benchmarks/registration/requirements.txt
    python benchmarks/registration/run.py            # --trials 5 --cases B for a quick look
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import os
import platform
import sys
import time
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import scenes  # noqa: E402
from floor import scan_floor  # noqa: E402
from peers import GLOBAL, LOCAL  # noqa: E402

START, MARK = "4deg10mm", "<!-- written by benchmarks/registration/run.py -->"
PACKAGES = ("numpy", "scipy", "libigl", "open3d", "small_gicp", "vtk", "kiss-matcher")


def bones(mesh: str | None) -> tuple[np.ndarray, np.ndarray, float, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """The bone that rays are cast on, its scale, and the models to register to."""
    if mesh is None:
        vertices, faces = scenes.reference_mesh()
        closed, scale = scenes.decimate(vertices, faces, 35678), 1.0
    else:
        vertices, faces, radius = scenes.load_real(mesh)
        closed, scale = scenes.decimate(vertices, faces, min(35678, int(len(faces) * 0.7))), radius / scenes.CUP_RADIUS
    shell = scenes.crop(*scenes.visible_shell(*closed), 75.0)
    return vertices, faces, scale, {"visible shell": shell, "whole bone": closed}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default="ABCDE")
    parser.add_argument("--trials", type=int, default=30)
    parser.add_argument("--seed-base", type=int, default=40000, help="seed of the first scan")
    parser.add_argument("--mesh", help="a hip bone in mm instead of the procedural one")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds a cell may take (five trials at least)")
    parser.add_argument("--only", default="", help="methods whose name contains this")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "benchmarks.md")
    options = parser.parse_args()
    vertices, faces, scale, models = bones(options.mesh)
    scene = scenes.Scene(vertices, faces)
    targets = scenes.cup_points(scenes.visible_shell(vertices, faces)[0], scale=scale)
    scans = {
        (case, k): scenes.make_scan(scene, case, options.seed_base + k, scale=scale)
        for case in options.cases
        for k in range(options.trials)
    }
    floors = {key: scan_floor(scan, targets) for key, scan in scans.items()}
    rows = []
    for model_name, model in models.items():
        for name, method in {**LOCAL, **GLOBAL}.items():
            if options.only not in name or (model_name == "whole bone" and "picoradar" not in name):
                continue
            began = time.process_time()
            method.prepare(*model)
            prepared_ms = (time.process_time() - began) * 1e3
            for case in options.cases:
                measured = cell(method, case, scans, floors, targets, options)
                rows.append((model_name, case, name, prepared_ms, *measured))
                print(*rows[-1], flush=True)
            write(options, rows)


def cell(method, case, scans, floors, targets, options):
    """Success, success where the floor allows it, error over floor, median CPU ms and trials of one method and case."""
    errors, times, began = [], [], time.perf_counter()
    for k in range(options.trials):
        if k >= 5 and time.perf_counter() - began > options.budget:
            break
        scan = scans[case, k]
        start = scenes.make_init(scan["T"], START, 1000 + k, scan["points"])
        clock = time.process_time()
        try:
            found = np.asarray(method(scan["points"].copy(), start), float)
        except (RuntimeError, ValueError) as error:
            print("  ", type(error).__name__, error)
            found = start
        times.append((time.process_time() - clock) * 1e3)
        errors.append(
            (*scenes.errors(found, scan["T"], targets), floors[case, k]["tre_med"], floors[case, k]["rot_deg"])
        )
    e = np.array(errors)
    right = (e[:, 0] < 1.0) & (e[:, 1] < 1.0)
    allowed = e[:, 4] < 0.35
    ratio = np.median(e[right, 2]) / np.median(e[:, 3]) if right.any() else np.nan
    return right.mean(), right[allowed].mean() if allowed.any() else np.nan, ratio, np.median(times), len(e)


def row_key(line: str) -> tuple[str, ...]:
    """Model, case and method of a row."""
    return tuple(cell.strip() for cell in line.split("|")[1:4])


def write(options, rows) -> None:
    """Put these rows into the part of the document below the mark; those of methods not run now stay there."""
    processor = Path("/proc/cpuinfo")
    lines = processor.read_text().splitlines() if processor.exists() else []
    cpu = next((line.split(":")[1].strip() for line in lines if "model name" in line), platform.machine())
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    bone = Path(options.mesh).name if options.mesh else "procedural socket"
    lines = [
        f"### {bone}, scans {options.seed_base} to {options.seed_base + options.trials - 1}",
        "",
        f"{datetime.date.today()}, {cpu}, one thread, Python {platform.python_version()}, {versions}.",
        "",
        "| model | case | method | success | where the floor allows | TRE / floor | CPU ms | prepare ms | trials |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for model, case, name, prepared, success, allowed, ratio, ms, count in sorted(rows, key=lambda r: (r[0], r[1])):
        cells = [
            f"{success:.0%}",
            "-" if np.isnan(allowed) else f"{allowed:.0%}",
            "-" if np.isnan(ratio) else f"{ratio:.2f}",
        ]
        lines.append(f"| {model} | {case} | {name} | {' | '.join(cells)} | {ms:.0f} | {prepared:.0f} | {count} |")
    text = options.out.read_text() if options.out.exists() else f"# Benchmarks\n\n{MARK}\n"
    head, _, old = text.partition(MARK)
    sections = [part.strip().removeprefix("### ") for part in old.split("\n### ") if part.strip()]
    before = next((part.splitlines() for part in sections if part.startswith(lines[0][4:])), [])
    if len(before) > 2 and before[2].split(",", 1)[1] == lines[2].split(",", 1)[1]:  # the same machine and versions
        done = {row_key(line) for line in lines}
        lines[6:] = sorted(lines[6:] + [line for line in before[6:] if row_key(line) not in done], key=row_key)
    kept = [part for part in sections if not part.startswith(lines[0][4:])]
    parts = ["\n".join(lines), *(f"### {part}" for part in kept)]
    options.out.write_text(head + MARK + "\n\n" + "\n\n".join(parts) + "\n")
    print(f"written: {options.out}")


if __name__ == "__main__":
    main()
