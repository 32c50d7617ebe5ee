"""Whether a change of structure changed a result: digests of whole jobs of two checkouts, side by side.

    python benchmarks/digests.py scans scans/                      # 60 seeded scans of the shipped hip, stored once
    python benchmarks/digests.py table ../before scans/ -o before.json
    python benchmarks/digests.py table . scans/ -o after.json      # about four minutes each
    python benchmarks/digests.py compare before.json after.json    # exit status 1 when anything differs

Clouds must be equal to the byte, figures of bench procedures to the last digit that they print, poses of the stored
scans to 1e-9 with the same verdicts. Tables of two machines need not agree: compare two checkouts on one machine.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

SEEDS = (1, 2, 3, 4, 5)
WINDOW_TARGETS = ("hip", "prism", "step")
PROCEDURES = {
    "distance": 11, "gray-target": 12, "templates": 13, "scanner": 14, "geometry": 15, "prism": 16, "drift": 17,
}  # fmt: skip
"""Procedures that need no person, each with the seed that it runs at."""

KINDS = {"bare": (0.0, 1.05), "tissue": (0.42, 1.05), "mostly tissue": (0.6, 1.05), "coarse": (0.3, 2.0)}
"""Share of tissue and raster step in mm of the stored scans, 15 of each."""

SCANS_OF_A_KIND = 15
POSE_TOLERANCE = 1e-9
CHANGING = ("wall_s", "prepare_ms", "register_ms", "report", "recording", "calibration", "calibration_digest")


def store_scans(folder: Path) -> None:
    """Make the scans that both checkouts register, and the model as the checkout in which this runs has it."""
    sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent / "registration")]
    import numpy as np
    import synthetic_scans as synthetic

    from picoradar.registration import load_model
    from picoradar.sim.physics import HIP_FILE, SOCKET_AXIS, SOCKET_CENTRE_MM

    folder.mkdir(parents=True)
    (folder / "model.stl").write_bytes(Path(HIP_FILE).read_bytes())
    model = load_model(HIP_FILE)
    for name, (tissue, step_mm) in KINDS.items():
        for k in range(SCANS_OF_A_KIND):
            made = synthetic.scan(
                model, np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS), 8100 + k, tissue=tissue, step_mm=step_mm
            )
            rows = np.column_stack([made.points, made.grid])
            np.savetxt(
                folder / f"{name.replace(' ', '-')}-{k:02d}.csv",
                rows,
                delimiter=",",
                header="x_mm,y_mm,z_mm,row,column",
                comments="",
                fmt=["%.9f"] * 3 + ["%d"] * 2,
            )


def call(checkout: Path, *arguments: str) -> dict[str, Any]:
    """Run a command of a checkout and return its JSON."""
    python = shutil.which("python3") or shutil.which("python") or sys.executable  # not the .venv that the run may renew
    line = [python, str(checkout / "run"), *arguments, "--json"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if not done.stdout.strip():
        raise SystemExit(f"{checkout}: {' '.join(arguments)}: {done.stderr[-2000:]}")
    return json.loads(done.stdout)


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def make_table(checkout: Path, scans: Path, out: Path) -> None:
    """Run all jobs and write what they gave."""
    table: dict[str, Any] = {}

    def keep(name: str, value: Any) -> None:
        table[name] = value
        print(name, json.dumps(value)[:100], file=sys.stderr, flush=True)
        out.write_text(json.dumps(table, indent=1))

    for stored in sorted(scans.glob("*.csv")):
        found = call(checkout, "register", str(stored), str(scans / "model.stl"))
        keep(f"register {stored.stem}", {"pose": found["model_from_scanner"], "verdict": found["verdict"]})
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for seed in SEEDS:
            found = call(checkout, "demo", "--seed", str(seed), "--out", str(folder / f"demo-{seed}"))
            described = {"flags": found["scan"]["flags"], "verdict": found["registration"]["verdict"]}
            cloud = folder / f"demo-{seed}" / "cloud.ply"
            keep(f"demo {seed}", {"cloud": digest(cloud), "truth_error": found["truth_error"], **described})
        for target in WINDOW_TARGETS:
            recording, cloud = folder / f"{target}.db", folder / f"{target}.ply"
            found = call(checkout, "scan", "--mode", "window", "--target", target, "--seed", "21", "-o", str(recording))
            call(checkout, "export", str(recording), "-o", str(cloud))
            described = {key: value for key, value in found.items() if key not in CHANGING}
            keep(f"window {target}", {"cloud": digest(cloud), **described})
        for name, seed in PROCEDURES.items():
            found = call(checkout, "bench", name, "--seed", str(seed), "--out", str(folder / name))
            keep(f"bench {name}", {"passed": found["passed"], "figures": found["figures"]})


def compare(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What differs, a line each."""
    differences = [f"{name}: only in one table" for name in sorted(set(before) ^ set(after))]
    for name in before.keys() & after.keys():
        one, other = before[name], after[name]
        if "pose" in one:
            largest = max(
                abs(a - b) for r, s in zip(one["pose"], other["pose"], strict=True) for a, b in zip(r, s, strict=True)
            )
            if largest > POSE_TOLERANCE or one["verdict"] != other["verdict"]:
                differences.append(f"{name}: pose differs by {largest:.2g}, {one['verdict']} -> {other['verdict']}")
        elif one != other:
            keys = sorted(key for key in one.keys() | other.keys() if one.get(key) != other.get(key))
            shown = ", ".join(f"{key} {one.get(key)} -> {other.get(key)}" for key in keys)
            differences.append(f"{name}: {shown}")
    return sorted(differences)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("scans").add_argument("folder", type=Path)
    tabled = verbs.add_parser("table")
    tabled.add_argument("checkout", type=Path)
    tabled.add_argument("scans", type=Path)
    tabled.add_argument("-o", dest="out", type=Path, required=True)
    compared = verbs.add_parser("compare")
    compared.add_argument("before", type=Path)
    compared.add_argument("after", type=Path)
    options = parser.parse_args()
    if options.verb == "scans":
        store_scans(options.folder)
        return 0
    if options.verb == "table":
        make_table(options.checkout.resolve(), options.scans.resolve(), options.out)
        return 0
    tables = [json.loads(path.read_text()) for path in (options.before, options.after)]
    found = compare(*tables)
    print(*(found or [f"all {len(tables[0])} entries equal"]), sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
