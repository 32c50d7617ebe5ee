"""Moves each numeric setting of the robust method by a factor of two either way; writes a table into the document.

    python benchmarks/registration/sensitivity.py --part robust --scans 12 --keep sensitivity.jsonl --write
    python benchmarks/registration/sensitivity.py --part model --scans 12 --keep sensitivity.jsonl --write

Seeded scans of the shipped hip bone, with 0, 30, 42 and 60 % of it under tissue from anywhere, with 42 % from a start
12 deg and 10 mm off, with 42 % and amplitudes, and of a small body without a hollow: ``--scans`` of each. A run that is
stopped goes on where it was when it is called again with the same ``--keep``. Shares, cosines and factors near one are
moved in their distance from one. Counts are rounded, and are at least 1.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import synthetic_scans as synthetic  # noqa: E402
from marked import provenance, write_between_marks  # noqa: E402
from setting_fields import numeric_fields, shown, with_moved  # noqa: E402

from picoradar.registration import (  # noqa: E402
    Model,
    PreparationSettings,
    RegistrationError,
    RobustSettings,
    load_model,
    prepare_model,
    register,
)
from picoradar.registration.se3 import inverse, rotation_angle_deg, transform  # noqa: E402

NAME = "benchmarks/registration/sensitivity.py"
BONE = ROOT / "sim" / "data" / "hip_right.stl"
FACTORS = (0.5, 2.0)
TISSUE = (0.0, 0.3, 0.42, 0.6)
SAME_MM = 0.005
"""Poses whose targets lie nearer than this count as unchanged."""

SAME_CPU = 0.05
"""CPU time that differs by a smaller share counts as unchanged."""


@dataclass(frozen=True)
class Case:
    """One scan with what it is registered to."""

    body: str
    points: np.ndarray
    truth: np.ndarray
    targets: np.ndarray
    options: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """What became of the scans: right or not, error at the worst target, verdict, CPU time, where the targets went."""

    right: list[bool]
    error_mm: list[float]
    verdict: list[str]
    cpu_s: list[float]
    places: list[list[list[float]]]


def block() -> tuple[np.ndarray, np.ndarray]:
    """A wedge with three different edges and no symmetry: a whole body without a hollow, mm."""
    v = np.array([[0, 0, 0], [62, 0, 0], [62, 41, 0], [0, 41, 0], [9, 6, 27], [33, 11, 19], [25, 30, 34.0]])
    f = [[0, 2, 1], [0, 3, 2], [0, 1, 5], [0, 5, 4], [1, 2, 5], [2, 6, 5], [2, 3, 6], [3, 0, 4], [3, 4, 6], [4, 5, 6]]
    return v, np.array(f)


def cases(models: dict[str, Model], scans: int, first_seed: int) -> list[Case]:
    """All scans, the same on every run."""
    hip, body = models["hip"], models["block"]
    view = hip.views[0]
    targets = view.centre + np.concatenate([np.zeros((1, 3)), 30.0 * np.eye(3), -30.0 * np.eye(3)])
    out = []
    for seed in range(first_seed, first_seed + scans):
        for tissue in TISSUE:
            seen = synthetic.scan(hip, view.centre, view.axis, seed, tissue=tissue)
            out.append(Case("hip", seen.points, seen.truth, targets, {"grid": seen.grid}))
        seen = synthetic.scan(hip, view.centre, view.axis, seed + 10_000, tissue=0.42)
        start = synthetic.start_off(seen.truth, seen.points, 12.0, 10.0, seed)
        out.append(Case("hip", seen.points, seen.truth, targets, {"start": start}))
        seen = synthetic.scan(hip, view.centre, view.axis, seed + 20_000, tissue=0.42)
        out.append(Case("hip", seen.points, seen.truth, targets, {"response_mv": amplitudes(hip, seen, seed)}))
        towards = np.array([0.3, -0.2, 0.93]) / np.linalg.norm([0.3, -0.2, 0.93])
        seen = synthetic.scan(body, body.centre, towards, seed + 30_000, tissue=0.0, coverage=1.0)
        corners = body.centre + 20.0 * np.concatenate([np.eye(3), -np.eye(3)])
        out.append(Case("block", seen.points, seen.truth, corners, {"grid": seen.grid}))
    return out


def amplitudes(model: Model, seen: synthetic.Synthetic, seed: int) -> np.ndarray:
    """Responses (N,) in mV: bone by its incidence, soft tissue a little over half of it, with 5 % of noise."""
    beams = seen.points / np.linalg.norm(seen.points, axis=1, keepdims=True)
    normals = model.closest(transform(seen.truth, seen.points)).normals
    cosine = np.clip(-np.einsum("ij,ij->i", normals, beams @ seen.truth[:3, :3].T), 0.0, 1.0)
    material = np.where(seen.height_mm > 0.0, 0.55, 1.0)
    return 60.0 * material * (0.3 + 0.7 * cosine) * np.random.default_rng([seed, 6]).normal(1.0, 0.05, len(cosine))


def outcome(taken: list[Case], models: dict[str, Model], settings: RobustSettings) -> Outcome:
    """Register all scans."""
    out = Outcome([], [], [], [], [])
    for case in taken:
        began = time.process_time()
        try:
            found = register(case.points, models[case.body], settings=settings, **case.options)
            pose, verdict = found.model_from_scanner, found.verdict
        except (RegistrationError, ValueError, np.linalg.LinAlgError) as error:
            pose, verdict = np.full((4, 4), np.nan), f"refused: {type(error).__name__}"
        out.cpu_s.append(time.process_time() - began)
        places = transform(pose, transform(inverse(case.truth), case.targets))
        error_mm = float(np.linalg.norm(places - case.targets, axis=1).max())
        turn = rotation_angle_deg(pose[:3, :3] @ case.truth[:3, :3].T)
        right = bool(turn < 1.0 and np.linalg.norm(places.mean(axis=0) - case.targets.mean(axis=0)) < 1.0)
        out.right.append(right)
        out.error_mm.append(error_mm)
        out.verdict.append(verdict)
        out.places.append(places.tolist())
    return out


def prepared(settings: PreparationSettings) -> dict[str, Model]:
    """Both models, prepared with such settings."""
    bone = load_model(BONE)
    return {
        "hip": prepare_model(bone.vertices, bone.faces, settings=settings),
        "block": prepare_model(*block(), settings=settings),
    }


def measured(path: tuple[str, ...], factor: float, taken: list[Case], usual: dict[str, Model]) -> Outcome:
    """The outcome with one field moved; "model" leads the paths of what a model is prepared with."""
    kind, *rest = path
    try:
        if kind == "model":
            models = prepared(with_moved(PreparationSettings(), tuple(rest), factor))
            return outcome(taken, models, RobustSettings())
        return outcome(taken, usual, with_moved(RobustSettings(), tuple(rest), factor))
    except (RegistrationError, ValueError, IndexError) as error:
        lost = [f"not prepared: {type(error).__name__}"] * len(taken)
        places = [np.full(case.targets.shape, np.nan).tolist() for case in taken]
        return Outcome([False] * len(taken), [float("inf")] * len(taken), lost, [float("nan")] * len(taken), places)


def row(path: tuple[str, ...], value: object, moved: list[Outcome], usual: Outcome) -> tuple[str, bool]:
    """A line of the table, and whether the field changes anything at all."""
    share, ratio, cpu, verdicts, poses = [], [], [], [], []
    for one in moved:
        both = np.array(one.right) & np.array(usual.right)
        share.append(f"{np.mean(one.right):.0%}")
        errors = np.array(one.error_mm)[both], np.array(usual.error_mm)[both]
        ratio.append(float(np.median(errors[0]) / np.median(errors[1])) if both.any() else float("nan"))
        cpu.append(float(np.median(np.array(one.cpu_s) / np.array(usual.cpu_s))))
        verdicts.append(sum(a != b for a, b in zip(one.verdict, usual.verdict, strict=True)))
        apart = [np.abs(np.array(a) - np.array(b)).max() for a, b in zip(one.places, usual.places, strict=True)]
        poses.append(sum(not distance < SAME_MM for distance in apart))
    idle = not any(verdicts) and not any(poses) and all(abs(c - 1.0) < SAME_CPU for c in cpu)
    cells = [
        ".".join(path[1:]),
        shown(value),
        f"{share[0]} / {np.mean(usual.right):.0%} / {share[1]}",
        " / ".join(f"{r:.2f}" for r in ratio),
        " / ".join(f"{c:.2f}" for c in cpu),
        " / ".join(map(str, poses)),
        " / ".join(map(str, verdicts)),
    ]
    return "| " + " | ".join(cells) + " |", idle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=12, help="of each of the seven kinds")
    parser.add_argument("--first-seed", type=int, default=60_000)
    parser.add_argument("--part", choices=("robust", "model"), default="robust", help="settings to move")
    parser.add_argument("--only", default="", help="fields whose path contains this")
    parser.add_argument("--keep", type=Path, help="file of results, to go on from")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PICORADAR_CACHE"] = folder
        table(options)


def table(options: argparse.Namespace) -> None:
    """Measure all fields; print, or write, the table."""
    usual_models = prepared(PreparationSettings())
    taken = cases(usual_models, options.scans, options.first_seed)
    outcome(taken[:7], usual_models, RobustSettings())  # imports and trees, made once
    kept = {}
    if options.keep and options.keep.exists():
        kept = {key: Outcome(**found) for key, found in map(json.loads, options.keep.read_text().splitlines())}

    def taken_or_measured(path: tuple[str, ...], factor: float) -> Outcome:
        key = f"{options.scans} {options.first_seed} {'.'.join(path)} {factor}"
        if key not in kept:
            kept[key] = measured(path, factor, taken, usual_models)
            if options.keep:
                with options.keep.open("a") as file:
                    file.write(json.dumps([key, vars(kept[key])]) + "\n")
        return kept[key]

    settings = RobustSettings() if options.part == "robust" else PreparationSettings()
    entries = [((options.part, *path), value) for path, value in numeric_fields(settings)]
    entries = [(path, value) for path, value in entries if options.only in ".".join(path)]
    usual = taken_or_measured(("robust", "noise", "typical_range_mm"), 1.0)
    lines, idle = [], []
    for number, (path, value) in enumerate(entries, start=1):
        line, is_idle = row(path, value, [taken_or_measured(path, factor) for factor in FACTORS], usual)
        lines.append(line)
        idle += [".".join(path[1:])] * is_idle
        print(f"{number:3}/{len(entries)} {line}{' idle' if is_idle else ''}", flush=True)
    head = [
        "| field | value | right at half / as set / at twice | error at the targets over that as set: half / twice "
        "| CPU ratio | poses changed | verdicts changed |",
        "|---|---|---|---|---|---|---|",
    ]
    note = (
        f"{provenance()} {len(taken)} scans, {options.scans} of each kind, seeds from {options.first_seed}. A pose has "
        f"changed when a target moves by {SAME_MM} mm. Fields that change nothing here: {', '.join(idle) or 'none'}."
    )
    print(note)
    if options.write:
        write_between_marks("registration.md", f"{NAME}, {options.part}", [note, "", *head, *lines])


if __name__ == "__main__":
    main()
