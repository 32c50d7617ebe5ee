"""Tables 4.1 to 4.6 and 5.1 of the dissertation run again with their parameters; writes docs/dissertation.md.

python benchmarks/registration/dissertation.py            # all, about ten minutes; writes tables and pictures
python benchmarks/registration/dissertation.py 4.1 4.3    # these only; the other rows stay
"""

from __future__ import annotations

import os
import re
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import dissertation_tables as tables  # noqa: E402 - threads must be limited first
import numpy as np  # noqa: E402
from bench_scans import BenchScan, take  # noqa: E402
from dissertation_pictures import Curves, draw_copies, draw_scans  # noqa: E402
from marked import provenance, rows_between_marks, write_between_marks  # noqa: E402
from through_instrument import Operation  # noqa: E402

from picoradar.registration import Model, load_model, pose_error, prepare_model, register  # noqa: E402
from picoradar.registration.se3 import transform  # noqa: E402
from picoradar.sim.physics import FOSSA_MM, HIP_FILE, SOCKET_AXIS, SOCKET_CENTRE_MM  # noqa: E402

NAME = "benchmarks/registration/dissertation.py"
CENTRE, AXIS = np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS)
FOSSA_RADIUS_MM = 14.0  # chosen: a fossa of 28 mm across
NOISE_MM = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
SEEDS = range(1)


def copies(table: str, model: Model, centre: np.ndarray, quoted: tuple[str, str], curves: Curves) -> list[str]:
    """Tables 4.1 and 4.2 on one model: exact copies at four offsets, noisy copies at 15 deg."""
    exact = [tables.copy(model, centre, angle, 0.0, 0, tables.TABLE_4_1) for angle in (0, 5, 10, 15)]
    curves.runs[table] = [entry.rms_mm for entry in exact[-1].result.history]
    rotation, shift, rms, step = (
        np.mean([getattr(c, key) for c in exact]) for key in ("rotation_deg", "translation_mm", "rms_mm", "step_mm")
    )
    lines = [
        f"| {table}: exact copy, 0 to 15 deg about x, mean of 4 | {quoted[0]} | {rotation:.2g} deg, {shift:.2g} mm; "
        f"residual rms {rms:.2g} mm, last step {step:.2g} mm |"
    ]
    levels = []
    for size in NOISE_MM:
        found = [tables.copy(model, centre, 15, size, seed, tables.TABLE_4_2) for seed in SEEDS]
        levels.append([np.mean([getattr(c, k) for c in found]) for k in ("rotation_deg", "translation_mm", "rms_mm")])
        print(table, size, *levels[-1], flush=True)
    curves.noise[table] = np.array(levels)
    for size, (rotation, shift, rms) in zip(NOISE_MM, levels, strict=True):
        if size in (0.1, 0.5, 1.0):
            cell = quoted[1] if size == 1.0 else "in fig. 4.4 and 4.11 only"
            name = f"{table}: noise {size} mm, 15 deg"
            lines.append(f"| {name} | {cell} | {rotation:.2g} deg, {shift:.2g} mm; residual rms {rms:.2g} mm |")
    return lines


def calibration() -> list[str]:
    """Table 4.3: a prism scanned by the simulated bench, registered to its computer model."""
    scan = take(43, target="prism", scan={"mode": "sweep"})
    model = prepare_model(*tables.prism())
    ours_from_bench = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 20], [0, 0, 0, 1]])
    truth = ours_from_bench @ scan.truth
    on_faces = transform(truth, scan.cloud.points_mm)[:, 2] > 1.0
    scan = replace(scan, cloud=scan.cloud.where(on_faces), truth=truth)
    start = tables.away_from(truth, scan.cloud.points_mm, 4.0, 14.0, seed=43)
    found = tables.match(scan, model, start, tables.TABLE_4_3)
    size = np.abs(found.plain.residuals)
    error = pose_error(found.plain.model_from_scanner, truth, np.array([0.0, 0, 20]))
    return [
        f"| 4.3: prism at 90 cm, start 4 deg and 14 mm off, {len(size)} points (dissertation 3321) "
        f"| 97 % within 1 mm, largest 1.3 mm; of the splatted surface: mean 0.52, SD 0.14 mm "
        f"| {np.mean(size < 1):.1%} within 1 mm, largest {size.max():.2f} mm; of the points: mean {size.mean():.2f}, "
        f"SD {size.std():.2f} mm; true error {error.rotation_deg:.2f} deg, {error.translation_mm:.2f} mm |"
    ]


def matched(name: str, quoted: list[str], scan: BenchScan, found: tables.Matched) -> list[str]:
    """Rows of tables 4.4 and 5.1: residuals after one run, effect of the elimination, true errors."""
    size = np.abs(found.plain.residuals)
    change = pose_error(found.eliminated.model_from_scanner, found.plain.model_from_scanner, CENTRE)
    kept = np.abs(found.eliminated.residuals[found.eliminated.inliers])
    own, better = (pose_error(r.model_from_scanner, scan.truth, CENTRE) for r in (found.eliminated, found.robust))
    return [
        f"| {name}: residuals after one run | {quoted[0]} | {(size > 1).sum()} of {len(size)} points beyond 1 mm "
        f"({np.mean(size > 1):.0%}), {(size > 3).sum()} beyond 3 mm; mean {size.mean():.2f}, SD {size.std():.2f}, "
        f"largest {size.max():.1f} mm |",
        f"| {name}: change by the elimination | {quoted[1]} | {change.rotation_deg:.2g} deg, "
        f"{change.translation_mm:.2g} mm; largest residual then {kept.max():.2f} mm |",
        f"| {name}: true error | could not be known | {own.rotation_deg:.2f} deg, {own.translation_mm:.2f} mm "
        f"(robust method: {better.rotation_deg:.2f} deg, {better.translation_mm:.2f} mm) |",
    ]


def cow_bone(wanted: set[str], curves: Curves) -> list[str]:
    """Tables 4.4 to 4.6: the bone scanned dry, then with clinical noise, then with less and less of its rim."""
    scan = take(44, tissue_share=0.15, scan={"mode": "sweep", "rows": 84, "columns": 84})
    offset = scan.in_model() - CENTRE
    lateral = np.linalg.norm(offset - np.outer(offset @ AXIS, AXIS), axis=1)
    scan = replace(scan, cloud=scan.cloud.where(np.argsort(np.argsort(lateral)) < 4283))
    model = prepare_model(scan.vertices, scan.faces)
    found = tables.match(scan, model, scan.landmarks, tables.TABLE_4_4)
    quoted = ["214 of 4283 points beyond 1 mm (5 %); mean 0.56, SD 0.26, largest 4.8 mm"]
    quoted += ["1e-6 deg, 1e-4 mm; largest residual then 0.92 mm"]
    lines = matched("4.4", quoted, scan, found)
    reference = found.eliminated.model_from_scanner
    clean = scan.cloud.where(found.eliminated.inliers)
    scan = replace(scan, cloud=clean, truth=reference)

    def against_reference(points: np.ndarray, settings: tables.DissertationSettings) -> tuple[float, float]:
        again = register(points, model, start=scan.landmarks, method="dissertation", settings=settings)
        error = pose_error(again.model_from_scanner, reference, CENTRE)
        return error.rotation_deg, error.translation_mm

    if "4.5" in wanted:
        shares = np.arange(0.1, 1.01, 0.1)
        errors = [
            against_reference(tables.clinical_noise(scan, share, 5.0, k), tables.TABLE_4_5)
            for k, share in enumerate(shares)
        ]
        curves.clinical = np.column_stack([shares, errors])
        text = {0.3: "0.03 deg, 0.29 mm", 1.0: "largest: 0.14 deg, 2 mm"}
        for share, (rotation, shift) in zip(shares, errors, strict=True):
            cell = text.get(round(share, 1), "in fig. 4.24 only")
            floor = tables.least_squares_deg(scan, model, reference, share, 5.0)
            lines.append(
                f"| 4.5: 5 mm noise on {share:.0%} of the points | {cell} | {rotation:.2g} deg, {shift:.2g} mm "
                f"(least squares predicts {floor:.2g} deg) |"
            )
    if "4.6" in wanted:
        shares = np.arange(0.1, 0.71, 0.1)
        kept = [tables.without_rim(scan, AXIS, CENTRE, share) for share in shares]
        errors = [against_reference(clean.points_mm[k], tables.TABLE_4_6) for k in kept]
        curves.access = np.column_stack([shares, errors])
        for share, (rotation, shift) in zip(shares, errors, strict=True):
            cell = "negligible" if share < 0.55 else "up to 2 deg, 8 mm"
            lines.append(f"| 4.6: {share:.0%} cut away from the rim | {cell} | {rotation:.2g} deg, {shift:.2g} mm |")
    return lines


def patient() -> list[str]:
    """Table 5.1: a wet socket with tissue, blood and retractors, 40 x 40 points from 85 cm."""
    before = Operation(None, 51, distance_mm=850.0)
    scan = take(51, dress=before, scan={"mode": "sweep", "distance_mm": 850.0})
    points = scan.cloud.points_mm
    near = np.linalg.norm(scan.in_model() - CENTRE, axis=1) < 40.0
    scan = replace(scan, cloud=scan.cloud.where(near))
    start = tables.away_from(scan.truth, points, 7.0, 30.0, seed=51)
    model = prepare_model(scan.vertices, scan.faces)
    quoted = ["633 of 1474 points beyond 1 mm (43 %), 186 beyond 3 mm; mean 1.338, SD 1.039, largest 9.3 mm"]
    quoted += ["0.30 deg, 0.33 mm"]
    found = tables.match(scan, model, start, tables.TABLE_5_1)
    return [*matched("5.1", quoted, scan, found), *without_fossa(scan, model, start, found)]


def without_fossa(scan: BenchScan, model: Model, start: np.ndarray, whole: tables.Matched) -> list[str]:
    """Section 5.3: how many outliers lie in the fossa, and what the others do when its points are cut away."""
    in_fossa = np.linalg.norm(scan.in_model() - FOSSA_MM, axis=1) < FOSSA_RADIUS_MM
    true_mm = np.abs(model.closest(scan.in_model()).signed_mm)
    found = tables.match(replace(scan, cloud=scan.cloud.where(~in_fossa)), model, start, tables.TABLE_5_1)
    change = pose_error(found.eliminated.model_from_scanner, found.plain.model_from_scanner, CENTRE)
    own, better = (pose_error(r.model_from_scanner, scan.truth, CENTRE) for r in (found.eliminated, found.robust))
    outliers = {"after one run": np.abs(whole.plain.residuals) > 1, "at the true pose": true_mm > 1}
    shares = "; ".join(f"{np.mean(in_fossa[far]):.0%} of {far.sum()} {where}" for where, far in outliers.items())
    return [
        f"| 5.1: outliers in the fossa ({in_fossa.sum()} points within {FOSSA_RADIUS_MM:g} mm of its floor) "
        f"| 57.3 % of 633 after one run | {shares} |",
        f"| 5.1: without the fossa, change by the elimination of the rest | 0.0054 deg, 0.0127 mm, read off fig. 5.10 "
        f"and not rerun | {change.rotation_deg:.2g} deg, {change.translation_mm:.2g} mm; true error "
        f"{own.rotation_deg:.2f} deg, {own.translation_mm:.2f} mm (robust method: {better.rotation_deg:.2f} deg, "
        f"{better.translation_mm:.2f} mm) |",
    ]


def main() -> None:
    wanted = set(sys.argv[1:]) or {"4.1", "4.3", "4.4", "4.5", "4.6", "5.1"}
    curves = Curves()
    new: dict[str, str] = {}

    def add(lines: list[str]) -> None:
        new.update({line.split("|")[1].strip(): line for line in lines})
        print("\n".join(lines), flush=True)

    if "4.1" in wanted:
        model = prepare_model(*tables.prism())
        quoted = ("2.7e-6 deg, 1.2e-5 mm; 'RMS' 4.2e-10 mm", "0.08 deg, 0.41 mm; 'RMS' 2.4e-6 mm")
        add(copies("4.1/4.2 prism", model, model.vertices.mean(axis=0), quoted, curves))
        quoted = ("7.3e-5 deg, 5.2e-5 mm; 'RMS' 0", "0.046 deg, 0.49 mm")
        add(copies("4.1/4.2 bone", load_model(HIP_FILE), CENTRE, quoted, curves))
        draw_copies(curves, ROOT / "docs" / "images" / "dissertation-copies.png", NOISE_MM)
    if "4.3" in wanted:
        add(calibration())
    if wanted & {"4.4", "4.5", "4.6"}:
        add(cow_bone(wanted, curves))
    if {"4.5", "4.6"} <= wanted:
        draw_scans(curves, ROOT / "docs" / "images" / "dissertation-scans.png")
    if "5.1" in wanted:
        add(patient())
    head = ["| table and run | dissertation | its method, rerun |", "|---|---|---|"]
    rows = rows_between_marks("dissertation.md", NAME, 3) | new
    body = [rows[key] for key in sorted(rows, key=order)]
    write_between_marks("dissertation.md", NAME, [provenance(), "", *head, *body])


def order(name: str) -> tuple[str, int]:
    """Rows stand by table, and as they came within one."""
    share = re.search(r"(\d+)%", name)
    return name[:3], int(share[1]) if share else 0


if __name__ == "__main__":
    main()
