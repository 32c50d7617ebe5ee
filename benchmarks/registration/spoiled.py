"""What scans and models that are not as they should be do to a pose, and whether that is stated; a table in the docs.

    python benchmarks/registration/spoiled.py --scans 10 --out spoiled.jsonl --bone procedural --bone hip.stl

In the environment of ``benchmarks/registration/requirements.txt``. Each row spoils scans (cases A and D), or the model,
by one error. `budgeted` registers with the error in the budget, as one standard deviation; `unsaid` without. The first
should hold what happens in 95 % of all cases, the second must not pass where the pose is wrong. What stands in the file
is not measured again.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import scenes  # noqa: E402
from judged import Judged, Kept, column, coverage, judged  # noqa: E402
from success import Bone  # noqa: E402
from volumes import VOLUMES, made_again  # noqa: E402

from picoradar.registration import ErrorBudget, prepare_model  # noqa: E402

NAME = "benchmarks/registration/spoiled.py"
USUAL = ErrorBudget(range_bias_mm=0.1)
Scan = dict[str, Any]
Mesh = tuple[np.ndarray, np.ndarray]


def ranges(scan: Scan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Beams (N, 3) in the scanner's frame, true ranges (N,) to what is there, and noise (N,) of the scan as made."""
    far = np.linalg.norm(scan["points"], axis=1)
    true = np.linalg.norm(scan["hit"] - scan["T"][:3, 3], axis=1) - scan["height"]
    return scan["points"] / far[:, None], true, far - true


def with_ranges(scan: Scan, beams: np.ndarray, measured: np.ndarray) -> Scan:
    """The scan with other ranges (N,)."""
    return {**scan, "points": beams * measured[:, None]}


def cosines(scan: Scan) -> np.ndarray:
    """Of incidence (N,), on bone."""
    return np.clip(np.abs(np.einsum("ij,ij->i", scan["dirs"], scan["normals"])), 0.1, 1.0)


def heavy_tails(scan: Scan, rng: np.random.Generator, _: Bone) -> Scan:
    """Student's t with 3 degrees of freedom, of the same variance."""
    beams, true, noise = ranges(scan)
    return with_ranges(scan, beams, true + scenes.SIGMA * rng.standard_t(3, len(noise)) / np.sqrt(3.0))


def grazing_noise(scan: Scan, _rng: np.random.Generator, _: Bone) -> Scan:
    beams, true, noise = ranges(scan)
    return with_ranges(scan, beams, true + noise / cosines(scan))


def line_noise(scan: Scan, rng: np.random.Generator, _: Bone) -> Scan:
    """0.2 mm common to a line: points of a line have the same y over z."""
    beams, true, noise = ranges(scan)
    line = np.unique(np.round(beams[:, 1] / beams[:, 2], 7), return_inverse=True)[1]
    return with_ranges(scan, beams, true + noise + 0.2 * rng.normal(size=line.max() + 1)[line])


def walk(scan: Scan, _rng: np.random.Generator, _: Bone) -> Scan:
    beams, true, noise = ranges(scan)
    return with_ranges(scan, beams, true + noise + 0.5 * (1.0 / cosines(scan) - 1.0))


def mirrors(scan: Scan, factor: Callable[[np.ndarray], np.ndarray]) -> Scan:
    """Mirror angles multiplied by a factor of the distance from the optical axis, mm."""
    far = np.linalg.norm(scan["points"], axis=1)
    tangent = scan["points"][:, :2] / scan["points"][:, 2:]
    lateral = np.linalg.norm(tangent, axis=1) * far
    beams = np.column_stack([tangent * factor(lateral)[:, None], np.ones(len(far))])
    return with_ranges(scan, beams / np.linalg.norm(beams, axis=1)[:, None], far)


def film(scan: Scan, rng: np.random.Generator, _: Bone) -> Scan:
    """0.6 mm in clumps over 40 % of the bone."""
    beams, true, noise = ranges(scan)
    covered = np.zeros(len(true), dtype=bool)
    while covered.mean() < 0.4:
        covered |= np.linalg.norm(scan["hit"] - scan["hit"][rng.integers(len(true))], axis=1) < rng.uniform(3.0, 8.0)
    return with_ranges(scan, beams, true + noise - np.where(covered & scan["inlier"], 0.6, 0.0))


def cartilage(scan: Scan, _rng: np.random.Generator, bone: Bone) -> Scan:
    """1.5 mm on what is near the socket's sphere: the lunate."""
    beams, true, noise = ranges(scan)
    off_sphere = np.abs(np.linalg.norm(scan["hit"], axis=1) - bone.scale * scenes.CUP_RADIUS)
    on = (off_sphere < 1.0) & scan["inlier"]
    return with_ranges(scan, beams, true + noise - np.where(on, 1.5 / cosines(scan), 0.0))


def range_zero(scan: Scan, _rng: np.random.Generator, _: Bone) -> Scan:
    beams, true, noise = ranges(scan)
    return with_ranges(scan, beams, true + noise + 1.5)


def along_normals(mesh: Mesh, by_mm: Callable[[np.ndarray], np.ndarray]) -> Mesh:
    """The mesh with its vertices (V, 3) moved out by a function of their places."""
    vertices, faces = mesh
    areas = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], areas)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    return vertices + by_mm(vertices)[:, None] * normals, faces


def waves(places: np.ndarray, rms_mm: float, rng: np.random.Generator, length_mm: float = 10.0) -> np.ndarray:
    """A smooth random field (V,) at `places` (V, 3): plane waves of this length in all directions."""
    ways = rng.normal(size=(40, 3))
    ways *= 2.0 * np.pi / length_mm / np.linalg.norm(ways, axis=1, keepdims=True)
    return rms_mm * np.cos(places @ ways.T + rng.uniform(0, 2 * np.pi, 40)).sum(axis=1) * np.sqrt(2.0 / 40.0)


@dataclass(frozen=True)
class Row:
    """One way to spoil a registration: its scan, or its model, and what a budget says of it."""

    name: str
    budget: ErrorBudget = USUAL
    scan: Callable[[Scan, np.random.Generator, Bone], Scan] | None = None
    mesh: Callable[[Mesh, np.random.Generator], Mesh] | None = None
    extra: dict[str, Any] = field(default_factory=dict)


def of_model(rms_mm: float, length_mm: float = 10.0, offset_mm: float = 0.0) -> ErrorBudget:
    """Budget of a random field on the model."""
    return replace(USUAL, sigma_model_mm=rms_mm, model_correlation_mm=length_mm, model_offset_mm=offset_mm)


def rows() -> list[Row]:
    """The rows of the table."""
    spoilt = [
        Row("nothing"),
        Row("t-noise, 3 degrees of freedom", scan=heavy_tails),
        Row("noise grows with incidence", scan=grazing_noise),
        Row("noise 0.2 mm common to a line", scan=line_noise),
        Row("walk 0.5 mm", replace(USUAL, walk_mm=0.5), walk),
        Row("mirror scale 1 %", replace(USUAL, mirror_scale=0.01), lambda s, *_: mirrors(s, lambda r: 1.01 + 0.0 * r)),
        Row(
            "pincushion 0.3 mm at 33 mm",
            replace(USUAL, mirror_scale=0.009),
            lambda s, *_: mirrors(s, lambda r: 1.0 + 0.3 / 33.0 * (r / 33.0) ** 2),
        ),
        Row("film 0.6 mm over 40 %", replace(of_model(0.3), range_bias_mm=0.3), film),
        Row("cartilage 1.5 mm", replace(USUAL, cartilage_mm=1.5), cartilage),
        Row("range zero 1.5 mm", replace(USUAL, range_bias_mm=1.5), range_zero),
    ]
    for sign in (0.5, -0.5):
        move = lambda mesh, _, by=sign: along_normals(mesh, lambda v: np.full(len(v), by))  # noqa: E731
        spoilt.append(Row(f"model {sign:+g} mm", replace(USUAL, model_offset_mm=0.5), mesh=move))
    for rms in (0.2, 0.4):
        wave = lambda mesh, rng, by=rms: along_normals(mesh, lambda v: waves(v, by, rng))  # noqa: E731
        spoilt.append(Row(f"segmentation {rms:g} mm rms", of_model(rms, 5.0), mesh=wave))
    spoilt.append(Row("model x 1.01", replace(USUAL, model_scale=0.01), mesh=lambda mesh, _: (1.01 * mesh[0], mesh[1])))
    for volume, sigma in zip(VOLUMES, (0.1, 0.17, 0.13), strict=True):
        again = lambda mesh, rng, v=volume: made_again(prepare_model(*mesh), v, int(rng.integers(1000)))  # noqa: E731
        spoilt.append(Row(volume.name, of_model(sigma, 5.0, 0.1), mesh=again))
    return spoilt


def run(bone: Bone, row: Row, options: argparse.Namespace, kept: Kept) -> None:
    """Register the scans of one row; each draw of a spoilt model serves some of them."""
    model, frame = None, np.eye(4)
    for k in range(options.scans):
        seed = options.seed_base + zlib.crc32(bone.name.encode()) % 1000 * 1000 + k
        draw = k // options.scans_a_model
        for case in options.cases:
            labels = [
                {"bone": bone.name, "model": row.name, "case": case, "seed": seed, "given": given}
                for given in ("budgeted", "unsaid")
            ]
            missing = [label for label in labels if label not in kept]
            if not missing:
                continue
            rng = np.random.default_rng([seed, zlib.crc32(row.name.encode())])
            if model is None or (row.mesh is not None and k % options.scans_a_model == 0 and case == options.cases[0]):
                of_draw = np.random.default_rng([options.seed_base, draw, 4])
                mesh = bone.models["whole"] if row.mesh is None else row.mesh(bone.models["whole"], of_draw)
                frame = scenes.pose(scenes.random_rotation(of_draw), of_draw.normal(size=3) * 300.0)
                model = prepare_model(scenes.apply(frame, mesh[0]), mesh[1])
            scan = scenes.make_scan(bone.scene, case, seed, scale=bone.scale)
            scan = scan if row.scan is None else row.scan(scan, rng, bone)
            for label in missing:
                budget = row.budget if label["given"] == "budgeted" else USUAL
                kept.add(judged(bone, model, frame, scan, label, budget=budget))


def report(done: list[Judged]) -> list[str]:
    """The table: rows of the two ways to register."""
    lines = [
        "| spoilt by | n | right | rotation deg, centre mm (median) | stated interval holds, % | stated / actual rms | "
        "budgeted: pass | unsaid: pass, of these beyond the tolerance |",
        "|---" * 8 + "|",
    ]
    names = dict.fromkeys(row.name for row in rows())
    for name in [*(n for n in names if any(one.model == n for one in done)), "all"]:
        here = [one for one in done if name in (one.model, "all")]
        with_it, without = ([one for one in here if one.given == given] for given in ("budgeted", "unsaid"))
        if not with_it or not without:
            continue
        inside = 100.0 * coverage(with_it, "stated_mm").mean()
        error, stated = column(with_it, "error_mm"), column(with_it, "stated_mm")
        wide = float(np.mean(stated.mean(axis=0) / np.sqrt((error**2).mean(axis=0))))
        passed = [one for one in without if one.verdict == "pass"]
        wrong = sum(not one.right for one in passed)
        lines.append(
            f"| {name} | {len(with_it)} | {np.mean([one.right for one in with_it]):.0%} | "
            f"{np.median(column(with_it, 'rotation_deg')):.2f}, {np.median(error[:, 0]):.2f} | "
            f"{inside:.0f} | {wide:.1f} | "
            f"{sum(one.verdict == 'pass' for one in with_it)} | {len(passed)}, {wrong} |"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bone", action="append", default=[], help="procedural or FILE, with *x,y,z to stretch it")
    parser.add_argument("--cases", default="AD")
    parser.add_argument("--scans", type=int, default=10, help="of each bone, case and row")
    parser.add_argument("--scans-a-model", type=int, default=5, help="registered to each draw of a spoilt model")
    parser.add_argument("--seed-base", type=int, default=950_000)
    parser.add_argument("--only", default="", help="rows whose name contains this")
    parser.add_argument("--out", type=Path, default=Path("spoiled.jsonl"))
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    kept = Kept(options.out)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PICORADAR_CACHE"] = folder
        for text in options.bone or ["procedural"]:
            bone = Bone.of(text)
            for row in rows():
                if options.only in row.name:
                    run(bone, row, options, kept)
            print(f"{bone.name}: {len(kept.done)} in {options.out}", flush=True)
    kept.tell(report(kept.done), NAME, write=options.write)


if __name__ == "__main__":
    main()
