"""Moves each numeric setting of the robust method by a factor of two either way; writes a table into the document.

    python benchmarks/registration/sensitivity.py --part robust --scans 12 --keep sensitivity.jsonl --write
    python benchmarks/registration/sensitivity.py --part model --scans 12 --keep sensitivity.jsonl --write
    python benchmarks/registration/sensitivity.py --part edges --scans 2 --keep sensitivity.jsonl --write

Seeded scans of the shipped hip bone, with 0, 30, 42 and 60 % of it under tissue from anywhere, with 42 % from a start
12 deg and 10 mm off, and with 42 % and amplitudes: ``--scans`` of each; for four of these one of a small body without a
hollow. The settings of edges, which take no part in a socket, are moved on scenes of ``sharp_scenes.py``: ``--scans``
times five of each of five kinds of body. A field is idle when no result changes in a single bit. A run that is stopped
goes on where it was when it is called again with the same ``--keep``. Shares, cosines and factors near one are moved in
their distance from one. Counts are rounded, and are at least 1.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
from marked import provenance, write_between_marks  # noqa: E402
from sensitivity_cases import Case, cases, prepared, sharp_cases  # noqa: E402
from setting_fields import numeric_fields, shown, with_moved  # noqa: E402

from picoradar.registration import (  # noqa: E402
    Model,
    PreparationSettings,
    Registration,
    RegistrationError,
    RobustSettings,
    register,
)
from picoradar.registration.se3 import inverse, rotation_angle_deg, transform  # noqa: E402

NAME = "benchmarks/registration/sensitivity.py"
GUARDS = Path(__file__).with_name("sensitivity_guards.toml")
FACTORS = (0.5, 2.0)
SAME_MM = 0.005
"""Poses whose targets lie nearer than this count as unchanged."""


@dataclass(frozen=True)
class Outcome:
    """What became of the scans: right or not, error at the worst target, verdict, CPU time, targets' places, bits."""

    right: list[bool]
    error_mm: list[float]
    verdict: list[str]
    cpu_s: list[float]
    places: list[list[list[float]]]
    bits: list[str]


def outcome(taken: list[Case], models: dict[str, Model], settings: RobustSettings) -> Outcome:
    """Register all scans."""
    out = Outcome([], [], [], [], [], [])
    for case in taken:
        began = time.process_time()
        try:
            found = register(case.points, models[case.body], settings=settings, **case.options, range_bias_mm=0.1)
            pose, verdict, bits = found.model_from_scanner, found.verdict, bits_of(found)
        except (RegistrationError, ValueError, np.linalg.LinAlgError) as error:
            pose, verdict, bits = np.full((4, 4), np.nan), f"refused: {type(error).__name__}", str(error)
        out.cpu_s.append(time.process_time() - began)
        ends = [transform(twin @ pose, transform(inverse(case.truth), case.targets)) for twin in case.symmetries]
        turns = [rotation_angle_deg(twin[:3, :3] @ pose[:3, :3] @ case.truth[:3, :3].T) for twin in case.symmetries]
        error_mm, places, turn = min(
            (float(np.linalg.norm(end - case.targets, axis=1).max()), end.tolist(), turn)
            for end, turn in zip(ends, turns, strict=True)
        )
        middle = np.mean(places, axis=0) - case.targets.mean(axis=0)
        right = bool(turn < 1.0 and np.linalg.norm(middle) < 1.0)
        out.right.append(right)
        out.error_mm.append(error_mm)
        out.verdict.append(verdict)
        out.places.append(places)
        out.bits.append(bits)
    return out


def bits_of(found: Registration) -> str:
    """A digest of all that a registration says."""
    rivals = [rival.model_from_scanner for rival in found.rivals]
    arrays = [found.model_from_scanner, found.covariance, found.inliers, found.residuals, *rivals]
    words = [found.verdict, *found.reasons, *(repr(target) for target in found.targets)]
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays) + "".join(words).encode()).hexdigest()[:12]


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
        return Outcome(
            [False] * len(taken), [float("inf")] * len(taken), lost, [float("nan")] * len(taken), places, lost
        )


def row(path: tuple[str, ...], value: object, moved: list[Outcome], usual: Outcome) -> tuple[str, bool]:
    """A line of the table, and whether the field changes anything at all."""
    share, ratio, cpu, verdicts, poses, results = [], [], [], [], [], []
    for one in moved:
        both = np.array(one.right) & np.array(usual.right)
        share.append(f"{np.mean(one.right):.0%}")
        errors = np.array(one.error_mm)[both], np.array(usual.error_mm)[both]
        ratio.append(float(np.median(errors[0]) / np.median(errors[1])) if both.any() else float("nan"))
        cpu.append(float(np.median(np.array(one.cpu_s) / np.array(usual.cpu_s))))
        verdicts.append(sum(a != b for a, b in zip(one.verdict, usual.verdict, strict=True)))
        apart = [np.abs(np.array(a) - np.array(b)).max() for a, b in zip(one.places, usual.places, strict=True)]
        poses.append(sum(not distance < SAME_MM for distance in apart))
        results.append(sum(a != b for a, b in zip(one.bits, usual.bits, strict=True)))
    cells = [
        ".".join(path[1:]),
        shown(value),
        f"{share[0]} / {np.mean(usual.right):.0%} / {share[1]}",
        " / ".join(f"{r:.2f}" for r in ratio),
        " / ".join(f"{c:.2f}" for c in cpu),
        " / ".join(map(str, results)),
        " / ".join(map(str, poses)),
        " / ".join(map(str, verdicts)),
    ]
    return "| " + " | ".join(cells) + " |", not any(results)


def explained(idle: list[str]) -> list[str]:
    """A table of what idle fields are for, each with a test; `sensitivity_guards.toml` says it.

    Raises
    ------
    ValueError
        Where it names a test that is not there.
    """
    lines = ["", "| idle field | what input it is for | test |", "|---|---|---|"]
    known: set[str] = set()
    for guard in tomllib.loads(GUARDS.read_text(encoding="utf-8"))["guard"]:
        known.update(guard["fields"])
        if not (fields := [name for name in guard["fields"] if name in idle]):
            continue
        file, _, test = guard["test"].partition("::")
        if f"def {test}(" not in (ROOT / file).read_text(encoding="utf-8"):
            raise ValueError(f"{GUARDS}: there is no test {guard['test']}; name another one of {guard['fields']}")
        lines.append(f"| {', '.join(fields)} | {guard['why']} | `{Path(file).name}::{test}` |")
    if missing := [name for name in idle if name not in known]:
        lines.append(f"| {', '.join(missing)} | not known: explain or remove | |")
    return lines if idle else []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=12, help="of each kind")
    parser.add_argument("--first-seed", type=int, default=60_000)
    parser.add_argument("--part", choices=("robust", "model", "edges"), default="robust", help="settings to move")
    parser.add_argument("--only", default="", help="fields whose path contains this")
    parser.add_argument("--keep", type=Path, help="file of results, to go on from")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PICORADAR_CACHE"] = folder
        table(options)


def table(options: argparse.Namespace) -> None:
    """Measure all fields; print, or write, the table."""
    if options.part == "edges":
        taken, usual_models = sharp_cases(options.scans, options.first_seed)
    else:
        usual_models = prepared(PreparationSettings())
        taken = cases(usual_models, options.scans, options.first_seed)
    outcome(taken[:7], usual_models, RobustSettings())  # imports and trees, made once
    kept = {}
    if options.keep and options.keep.exists():
        kept = {key: Outcome(**found) for key, found in map(json.loads, options.keep.read_text().splitlines())}

    def taken_or_measured(path: tuple[str, ...], factor: float) -> Outcome:
        key = f"{options.part == 'edges'} {options.scans} {options.first_seed} {'.'.join(path)} {factor}"
        if key not in kept:
            kept[key] = measured(path, factor, taken, usual_models)
            if options.keep:
                with options.keep.open("a") as file:
                    file.write(json.dumps([key, vars(kept[key])]) + "\n")
        return kept[key]

    settings, kind = (PreparationSettings(), "model") if options.part == "model" else (RobustSettings(), "robust")
    entries = [((kind, *path), value) for path, value in numeric_fields(settings)]
    entries = [(path, value) for path, value in entries if (path[1] == "edges") == (options.part == "edges")]
    entries = [(path, value) for path, value in entries if options.only in ".".join(path)]
    entries = [(path, value) for path, value in entries if with_moved(settings, path[1:], 2.0) != settings]  # infinite
    usual = taken_or_measured(("robust", "noise", "typical_range_mm"), 1.0)
    lines, idle = [], []
    for number, (path, value) in enumerate(entries, start=1):
        line, is_idle = row(path, value, [taken_or_measured(path, factor) for factor in FACTORS], usual)
        lines.append(line)
        idle += [".".join(path[1:])] * is_idle
        print(f"{number:3}/{len(entries)} {line}{' idle' if is_idle else ''}", flush=True)
    head = [
        "| field | value | right at half / as set / at twice | error at the targets over that as set: half / twice "
        "| CPU ratio | results changed | poses changed | verdicts changed |",
        "|---|---|---|---|---|---|---|---|",
    ]
    note = (
        f"{provenance()} {len(taken)} scans, seeds from {options.first_seed}. A pose has changed when a target moves "
        f"by {SAME_MM} mm, a result when any bit of it does. Fields that change none are idle: {len(idle)}."
    )
    print(note)
    if options.write:
        write_between_marks("registration.md", f"{NAME}, {options.part}", [note, "", *head, *lines, *explained(idle)])


if __name__ == "__main__":
    main()
