"""Whether predicted errors are true: coverage, actual over predicted, wrong passes; a table in docs/registration.md.

    python benchmarks/registration/calibrated.py --scans 40 --out found.jsonl "--bone=hip.stl*-1.06,0.95,1.02"

In the environment of ``benchmarks/registration/requirements.txt``. Bones as in ``success.py``; every bone whole and as
the shell that a scanner sees, in a random frame, from anywhere, with and without covariances. What stands in the file
is not measured again, so that a run resumes. Seeds from 300000 on chose the settings; seeds from 900000 on are for
reports.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import zlib
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import scenes  # noqa: E402
from judged import PLACES, Judged, Kept, column, coverage, judged, ratio  # noqa: E402
from success import Bone  # noqa: E402

from picoradar.registration import prepare_model  # noqa: E402

NAME = "benchmarks/registration/calibrated.py"
RANGE_BIAS_MM = 0.1
BINS = 6
POINTING_MM = 1e-3
"""Standard deviation across the beam in the covariances given: these scans have none."""


def covariances(points: np.ndarray, range_mm: float = scenes.SIGMA) -> np.ndarray:
    """Covariances (N, 3, 3) of points that the scanner at the origin saw with this noise along the beam."""
    beams = points / np.linalg.norm(points, axis=1)[:, None]
    along = beams[:, :, None] * beams[:, None, :]
    return np.asarray(range_mm**2 * along + POINTING_MM**2 * (np.eye(3) - along))


def bench(bone: Bone, options: argparse.Namespace, kept: Kept) -> Iterator[tuple[Any, ...]]:
    """What is still to be registered of a bone: its models, with their frames, and scans of all cases."""
    rng = np.random.default_rng([options.seed_base, 3])
    model_from_cup = scenes.pose(scenes.random_rotation(rng), rng.normal(size=3) * 300.0)
    offset = zlib.crc32(bone.name.encode()) % 1000 * 1000  # no two bones share their poses
    for name, (vertices, faces) in bone.models.items():
        model = prepare_model(scenes.apply(model_from_cup, vertices), faces)
        for case in options.cases:
            for k in range(options.scans if case != "C" else max(1, options.scans // 2)):
                seed = options.seed_base + offset + k
                labels = [
                    {"bone": bone.name, "model": name, "case": case, "seed": seed, "given": given}
                    for given in options.given.split(",")
                ]
                if missing := [label for label in labels if label not in kept]:
                    yield model, model_from_cup, scenes.make_scan(bone.scene, case, seed, scale=bone.scale), missing


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bone", action="append", default=[], help="procedural or FILE, with *x,y,z to stretch it")
    parser.add_argument("--cases", default="ABCDEF")
    parser.add_argument("--scans", type=int, default=20, help="of each case, bone and model; half of it of C")
    parser.add_argument("--given", default="points,covariances", help="with covariances, without, or both")
    parser.add_argument("--seed-base", type=int, default=900_000, help="seed of the first scan")
    parser.add_argument("--out", type=Path, default=Path("calibrated.jsonl"))
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    kept = Kept(options.out)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PICORADAR_CACHE"] = folder
        for text in options.bone or ["procedural"]:
            bone = Bone.of(text)
            for model, frame, scan, missing in bench(bone, options, kept):
                for label in missing:
                    given = {"covariance": covariances(scan["points"])} if label["given"] == "covariances" else {}
                    kept.add(judged(bone, model, frame, scan, label, range_bias_mm=RANGE_BIAS_MM, **given))
            print(f"{bone.name}: {len(kept.done)} in {options.out}", flush=True)
    kept.tell(report(kept.done), NAME, write=options.write)


def report(rows: list[Judged]) -> list[str]:
    """The tables: by case, and by bin of the predicted error."""
    lines = [
        "| case, given | n | right | covered, %: centre | rim | 50 mm | 100 mm | actual / predicted, not failed | "
        "predicted / floor: centre, rotation | pass of the right ones that the floor allows | wrong passes | CPU ms |",
        "|---" * 12 + "|",
    ]
    keys = sorted({(row.case, row.given) for row in rows})
    lines += [_row(f"{case}, {given}", [r for r in rows if (r.case, r.given) == (case, given)]) for case, given in keys]
    lines += [_row("all", rows), "", "| predicted rms, mm | n | covered, % | actual rms, mm |", "|---" * 4 + "|"]
    predicted = np.concatenate(column(rows, "rms_mm"))
    inside, actual = np.concatenate(coverage(rows)), np.concatenate(column(rows, "error_mm"))
    edges = np.quantile(predicted, np.linspace(0.0, 1.0, BINS + 1))
    for low, high in pairwise(edges):
        here = (predicted >= low) & (predicted <= high)
        rms = float(np.sqrt(np.mean(actual[here] ** 2)))
        lines.append(f"| {low:.3f} to {high:.3f} | {here.sum()} | {100 * inside[here].mean():.1f} | {rms:.3f} |")
    return lines


def _row(name: str, rows: list[Judged]) -> str:
    inside, places = 100.0 * coverage(rows), np.array(PLACES)
    covered = " | ".join(f"{inside[:, places == p].mean():.1f}" for p in dict.fromkeys(PLACES))
    accepted = [row for row in rows if row.verdict != "fail"] or rows[:1]
    able = [row for row in rows if row.right and row.able]
    wrong = sum(row.verdict == "pass" and not row.right for row in rows)
    centre = np.median(column(rows, "rms_mm")[:, 0] / column(rows, "floor_mm"))
    turn = np.median(column(rows, "predicted_rotation_deg") / column(rows, "floor_deg"))
    passed = f"{np.mean([row.verdict == 'pass' for row in able]):.1%} of {len(able)}" if able else "-"
    right, cpu = np.mean([row.right for row in rows]), np.median(column(rows, "cpu_ms"))
    cells = [
        f"{len(rows)}",
        f"{right:.1%}",
        covered,
        f"{ratio(accepted):.2f} of {len(accepted)}",
        f"{centre:.2f}, {turn:.2f}",
        passed,
        f"{wrong}",
        f"{cpu:.0f}",
    ]
    return f"| {name} | {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
