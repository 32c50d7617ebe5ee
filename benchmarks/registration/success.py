"""Success from anywhere, error over floor and CPU time, on bones of any kind; writes a table into docs/benchmarks.md.

    python benchmarks/registration/success.py --bone procedural --scans 20
    python benchmarks/registration/success.py --bone procedural "--bone=hip.stl*-1.06,0.95,1.02" --write

In the environment of ``benchmarks/registration/requirements.txt``. A bone is ``procedural`` or a mesh in mm; numbers
behind a ``*`` stretch it along its axes, and an odd number of negative ones mirrors it: shapes that no program has
seen, and sockets that are no spheres. Every model stands in a frame of its own, drawn from the seed; no start is given.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import scenes  # noqa: E402
from floor import scan_floor  # noqa: E402
from marked import provenance, write_between_marks  # noqa: E402

from picoradar.registration import RegistrationError, prepare_model, register  # noqa: E402

NAME = "benchmarks/registration/success.py"
ALLOWED_DEG = 0.35
"""Floor of the rotation below which a scan can be expected to succeed."""

FACES = 35_678
SHARE_OF_SCANS = {"A": 1 / 3, "B": 1.0, "C": 1 / 3, "D": 1.0, "E": 1.0}
"""Cases with little to go wrong take fewer scans."""


@dataclass(frozen=True)
class Bone:
    """A bone that rays are cast on, and the models of it that scans are registered to."""

    name: str
    scene: scenes.Scene
    scale: float
    targets: np.ndarray
    models: dict[str, tuple[np.ndarray, np.ndarray]]

    @classmethod
    def of(cls, text: str) -> Bone:
        """Make the bone that ``--bone`` describes."""
        source, _, factors = text.partition("*")
        stretch = np.array([float(v) for v in factors.split(",")]) if factors else np.ones(3)
        if source == "procedural":
            vertices, faces = scenes.reference_mesh()
        else:
            vertices, faces, _ = scenes.load_real(source)
        vertices, faces, radius = scenes.socket_frame(vertices * stretch, faces)
        closed = vertices, faces
        if len(faces) > FACES / 2:
            closed = scenes.decimate(vertices, faces, min(FACES, int(0.7 * len(faces))))
        shell = scenes.crop(*scenes.visible_shell(*closed), 75.0)
        scale = radius / scenes.CUP_RADIUS
        targets = scenes.cup_points(scenes.visible_shell(vertices, faces)[0], scale=scale)
        name = Path(source).stem + (f" x {factors.replace(',', ', ')}" if factors else "")
        return cls(name, scenes.Scene(vertices, faces), scale, targets, {"whole": closed, "shell": shell})


def prepared(vertices: np.ndarray, faces: np.ndarray):
    """The model with the CPU ms of its first preparation and of reading it again."""
    times = []
    for _ in range(2):
        began = time.process_time()
        model = prepare_model(vertices, faces)
        times.append((time.process_time() - began) * 1e3)
    return model, *times


def cell(bone: Bone, model, model_from_cup: np.ndarray, scans: list[dict]) -> tuple[str, list]:
    """Register scans; the cell of the table, and what went wrong."""
    times, errors, misses = [], [], []
    for seed, scan, floor in scans:
        points = scan["points"].copy()
        began = time.process_time()
        try:
            found = register(points, model, range_bias_mm=0.1)
            pose, verdict = found.model_from_scanner, found.verdict
        except RegistrationError as error:
            pose, verdict = model_from_cup, f"refused: {error}"
        times.append((time.process_time() - began) * 1e3)
        turn, shift, largest = scenes.errors(scenes.inv(model_from_cup) @ pose, scan["T"], bone.targets)
        right = turn < 1.0 and shift < 1.0
        errors.append((right, floor["rot_deg"] < ALLOWED_DEG, largest, floor["tre_med"]))
        if not right:
            misses.append((seed, round(float(turn), 2), round(float(shift), 2), round(floor["rot_deg"], 2), verdict))
    right, allowed, largest, floors = (np.array(column) for column in zip(*errors, strict=True))
    share = f"{right.mean():.1%}"
    if not allowed.all():
        share += f" / {right[allowed].mean():.1%} of {allowed.sum()}" if allowed.any() else " / none allowed"
    ratio = np.median(largest[right]) / np.median(floors)
    return f"{share}, {ratio:.2f}, {np.median(times):.0f} ms".replace("100.0%", "100%"), misses


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bone", action="append", default=[], help="procedural or FILE, with *x,y,z to stretch it")
    parser.add_argument("--model", choices=("whole", "shell"), default="whole")
    parser.add_argument("--cases", default="ABCDE")
    parser.add_argument("--scans", type=int, default=100, help="of cases B, D, E; a third of it of A and C")
    parser.add_argument("--seed-base", type=int, default=50_000, help="seed of the first scan")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PICORADAR_CACHE"] = folder
        table(options)


def table(options: argparse.Namespace) -> None:
    """Measure all bones and print, or write, the table."""
    heading = " | ".join(f"{case}: success / where allowed, TRE / floor, CPU" for case in options.cases)
    lines = [
        f"| bone, {options.model} model | faces | prepared, again, CPU ms | {heading} |",
        "|---" * (3 + len(options.cases)) + "|",
    ]
    print(*lines, sep="\n", flush=True)
    missed = []
    for text in options.bone or ["procedural"]:
        bone = Bone.of(text)
        rng = np.random.default_rng([options.seed_base, 3])
        model_from_cup = scenes.pose(scenes.random_rotation(rng), rng.normal(size=3) * 300.0)
        vertices, faces = bone.models[options.model]
        model, first_ms, again_ms = prepared(scenes.apply(model_from_cup, vertices), faces)
        cells = []
        for case in options.cases:
            seeds = range(options.seed_base, options.seed_base + max(1, round(SHARE_OF_SCANS[case] * options.scans)))
            scans = [(seed, scenes.make_scan(bone.scene, case, seed, scale=bone.scale)) for seed in seeds]
            scans = [(seed, scan, scan_floor(scan, bone.targets)) for seed, scan in scans]
            if case == options.cases[0]:
                register(scans[0][1]["points"], model, range_bias_mm=0.1)  # imports and trees, made once
            text, misses = cell(bone, model, model_from_cup, scans)
            cells.append(text)
            missed += [(bone.name, case, *miss) for miss in misses]
        lines.append(f"| {bone.name} | {len(faces)} | {first_ms:.0f}, {again_ms:.0f} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    print("missed (bone, case, seed, rotation deg, centre mm, floor deg, verdict):", *missed, sep="\n  ")
    wrong = sum(miss[-1] == "pass" for miss in missed)
    note = (
        f"{provenance()} Scans from seed {options.seed_base} on: {options.scans} of B, D and E, a third of it of A and "
        f"C. {wrong} of the {len(missed)} missed were called 'pass'."
    )
    if options.write:
        write_between_marks("benchmarks.md", f"{NAME}, {options.model} models", [note, "", *lines])


if __name__ == "__main__":
    main()
