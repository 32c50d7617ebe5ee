"""The prism tables of the dissertation run again with its parameters; writes docs/dissertation.md below its mark.

python benchmarks/registration/dissertation.py
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402 - threads must be limited first

from registration import DissertationSettings, pose_error, prepare_model, register  # noqa: E402
from registration.dissertation import register_dissertation  # noqa: E402
from registration.rigid import inverse, pose, rotation_from_vector, transform  # noqa: E402

MARK = "<!-- written by benchmarks/registration/dissertation.py -->"
ABOUT_X = np.array([1.0, 0.0, 0.0])


def prism() -> tuple[np.ndarray, np.ndarray]:
    """Two sloping faces over a 40 x 40 mm base, ridge 40 mm high: 3321 points, 81 x 41 (S 4.1.1)."""
    along_slope, along_ridge = np.meshgrid(np.linspace(-20, 20, 81), np.linspace(-20, 20, 41), indexing="ij")
    height = 40.0 - 2.0 * np.abs(along_slope)
    vertices = np.stack([along_slope.ravel(), along_ridge.ravel(), height.ravel()], axis=1)
    a = (np.arange(80)[:, None] * 41 + np.arange(40)).ravel()
    return vertices, np.concatenate([np.stack([a, a + 41, a + 42], axis=1), np.stack([a, a + 42, a + 1], axis=1)])


def noisy(points: np.ndarray, size_mm: float, share: float, seed: int) -> np.ndarray:
    """Gaussian noise of `size_mm` on a share of the points (S 3.4.2)."""
    rng = np.random.default_rng(seed)
    hit = rng.random(len(points)) < share
    return points + np.where(hit[:, None], rng.normal(0.0, size_mm, points.shape), 0.0)


def offset(angle_deg: float, centre: np.ndarray) -> np.ndarray:
    """The data's offset: a turn about the x axis through the model's centre."""
    rotation = rotation_from_vector(np.radians(angle_deg) * ABOUT_X)
    return pose(rotation, centre - rotation @ centre)


def row(name: str, quoted: str, points: np.ndarray, model, start_deg: float, settings: DissertationSettings) -> str:
    """Register by the dissertation's method and by the robust one, and print both beside the dissertation's figure."""
    centre = model.vertices.mean(axis=0)
    truth = inverse(offset(start_deg, centre))
    data = transform(inverse(truth), points)
    faithful = register_dissertation(data, model.surface, np.eye(4), settings)
    old = pose_error(faithful.model_from_scanner, truth, centre)
    robust = register(data, model, start=np.eye(4), origin=centre + np.array([0.0, 0.0, 900.0]))
    new = pose_error(robust.model_from_scanner, truth, centre)
    text = (
        f"| {name} | {quoted} | {old.rotation_deg:.2g} deg, {old.translation_mm:.2g} mm "
        f"| {new.rotation_deg:.2g} deg, {new.translation_mm:.2g} mm |"
    )
    print(text, flush=True)
    return text


def main() -> None:
    vertices, faces = prism()
    model = prepare_model(vertices, faces)
    plain = DissertationSettings(max_iterations=40, suppression_runs=0, outlier_threshold_mm=None, tolerance_mm2=1e-16)
    suppressed = DissertationSettings(
        max_iterations=40,
        suppression_runs=5,
        perturbation_deg=7.5,
        perturbation_mm=1.2,
        outlier_threshold_mm=None,
        tolerance_mm2=1e-12,
    )
    rows = [
        row(f"4.1, exact copy, {angle} deg about x", "2.7e-6 deg, 1.2e-5 mm", vertices, model, angle, plain)
        for angle in (0, 5, 10, 15)
    ]
    for size in (0.1, 0.5, 1.0):
        quoted = "0.08 deg, 0.41 mm" if size == 1.0 else "-"
        data = noisy(vertices, size, 1.0, seed=int(10 * size))
        rows.append(row(f"4.2, noise {size} mm, 15 deg about x", quoted, data, model, 15, suppressed))
    table = [
        "| table, run | dissertation | its method, rerun | robust method |",
        "|---|---|---|---|",
        *rows,
    ]
    out = ROOT / "docs" / "dissertation.md"
    head = out.read_text().partition(MARK)[0]
    out.write_text(head + MARK + "\n\n" + "\n".join(table) + "\n")
    print(f"written: {out}")


if __name__ == "__main__":
    main()
