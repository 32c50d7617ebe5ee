"""The family of robust criteria on the same scans, outlier shares 0 to 60 %; writes docs/registration.md and a picture.

python benchmarks/registration/criteria.py            # about ten minutes; --scans 3 for a quick look
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import matplotlib as mpl  # noqa: E402 - threads must be limited first

mpl.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import synthetic_scans as synthetic  # noqa: E402
from marked import provenance, rows_between_marks, write_between_marks  # noqa: E402

from picoradar.registration import DissertationSettings, load_model, pose_error, register  # noqa: E402
from picoradar.registration.classic import (  # noqa: E402
    LOSSES,
    head_and_hat,
    lm_icp,
    plane_icp,
    register_dissertation,
)
from picoradar.registration.model import build_fields, part, visible_shell  # noqa: E402
from picoradar.sim.physics import HIP_FILE, SOCKET_AXIS, SOCKET_CENTRE_MM  # noqa: E402

NAME = "benchmarks/registration/criteria.py"
CENTRE, AXIS = np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS)
SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
START_DEG, START_MM = 4.0, 10.0
STEP_MM = 1.27
SLOW = ("head and hat", "dissertation")
NEAR_SOCKET_MM = 60.0

Method = Callable[[synthetic.Synthetic, np.ndarray], np.ndarray]


def methods() -> dict[str, Method]:
    """Each takes a scan and a start pose and returns `model_from_scanner`."""
    model = load_model(HIP_FILE)
    centroids = model.vertices[model.faces].mean(axis=1)
    near = part(model.surface, np.linalg.norm(centroids - CENTRE, axis=1) < NEAR_SOCKET_MM)
    shell = visible_shell(model.surface, AXIS, only=near)
    field, _ = build_fields(shell, shell.vertices.min(axis=0) - 8.0, shell.vertices.max(axis=0) + 8.0)

    def by_criterion(name: str, scan: synthetic.Synthetic, start: np.ndarray) -> np.ndarray:
        return plane_icp(scan.points, shell, start, LOSSES[name])

    found: dict[str, Method] = {f"plane ICP, {name}": partial(by_criterion, name) for name in LOSSES}
    found["LM-ICP (Huber on a field)"] = lambda scan, start: lm_icp(scan.points, field, start)
    found["head and hat"] = lambda scan, start: head_and_hat(scan.points, shell, start, CENTRE)
    settings = DissertationSettings()
    found["dissertation"] = lambda scan, start: (
        register_dissertation(scan.points, shell, start, settings).model_from_scanner
    )
    found["robust, same start"] = lambda scan, start: (
        register(scan.points, model, start=start, grid=scan.grid).model_from_scanner
    )
    found["robust, from anywhere"] = lambda scan, _: register(scan.points, model, grid=scan.grid).model_from_scanner
    return found


def measured(method: Method, scans: list[tuple[synthetic.Synthetic, np.ndarray]]) -> tuple[float, float, float]:
    """Share within 1 deg and 1 mm, and median rotation error (deg) and shift of the socket's centre (mm)."""
    errors = [pose_error(method(scan, start), scan.truth, CENTRE) for scan, start in scans]
    rotation = np.array([e.rotation_deg for e in errors])
    shift = np.array([e.translation_mm for e in errors])
    return float(np.mean((rotation < 1.0) & (shift < 1.0))), float(np.median(rotation)), float(np.median(shift))


def drawn(rows: dict[str, str], path: Path) -> None:
    """Success and median rotation error against the outlier share, from the rows of the table."""
    figure, (success, rotation) = plt.subplots(1, 2, figsize=(12, 5.5), layout="constrained")
    for k, (name, row) in enumerate(rows.items()):
        table = np.array(re.findall(r"(\d+)%, ([\d.e+-]+)", row), dtype=np.float64)
        style = {"color": f"C{k % 10}", "linestyle": ("-", "--")[k // 10], "marker": "osv^D"[k % 5], "markersize": 4}
        if name.startswith("robust"):
            style |= {"linewidth": 3.0, "color": "black"}
        success.plot(100 * np.array(SHARES), table[:, 0], label=name, **style)
        rotation.semilogy(100 * np.array(SHARES), table[:, 1], **style)
    success.set(xlabel="points under tissue, %", ylabel="within 1 deg and 1 mm, % of the scans")
    rotation.set(xlabel="points under tissue, %", ylabel="median rotation error, deg")
    rotation.axhline(1.0, color="0.7", zorder=0)
    figure.legend(loc="outside right center", fontsize=8)
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=10, help="for each outlier share")
    parser.add_argument("--slow-scans", type=int, default=4, help="the same for methods that take half a minute a scan")
    parser.add_argument("--only", default="", help="methods whose name contains this; the others' rows stay")
    options = parser.parse_args()
    model = load_model(HIP_FILE)
    scans = {}
    for share in SHARES:
        taken = [
            synthetic.scan(model, CENTRE, AXIS, seed, tissue=share, step_mm=STEP_MM) for seed in range(options.scans)
        ]
        scans[share] = [
            (s, synthetic.start_off(s.truth, s.points, START_DEG, START_MM, k)) for k, s in enumerate(taken)
        ]
    rows = rows_between_marks("registration.md", NAME, 1 + len(SHARES)) if options.only else {}
    for name, method in methods().items():
        if options.only not in name:
            continue
        count = options.slow_scans if name in SLOW else options.scans
        results = [measured(method, scans[share][:count]) for share in SHARES]
        rows[name] = f"| {name} | " + " | ".join(f"{right:.0%}, {turn:.2g}" for right, turn, _ in results) + " |"
        print(rows[name], flush=True)
    points = np.median([len(s.points) for taken in scans.values() for s, _ in taken])
    slow = f"({options.slow_scans} for {' and '.join(SLOW)})"
    note = (
        f"{options.scans} scans a share {slow}, {points:.0f} points each, start {START_DEG:g} deg, {START_MM:g} mm off."
    )
    drawn(rows, ROOT / "docs" / "images" / "criteria.png")
    head = ["| method | " + " | ".join(f"{s:.0%}" for s in SHARES) + " |", "|---" * 8 + "|"]
    write_between_marks("registration.md", NAME, [f"{provenance()} {note}", "", *head, *rows.values()])


if __name__ == "__main__":
    main()
