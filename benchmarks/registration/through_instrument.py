"""Registration through the instrument: simulated bench, windows, wet bone under tissue and blood, from any pose.

python benchmarks/registration/through_instrument.py --scans 20            # prints every scan and a summary
python benchmarks/registration/through_instrument.py --scans 100 --write   # and writes docs/registration.md
python benchmarks/registration/through_instrument.py --mesh other_hip.stl  # instead of the shipped one, mm

Each scan runs through drivers, firmware, ranging and recording; covariances, responses and raster places are given to
`register`, landmarks are not, and the model stands in a frame of its own.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import scenes  # noqa: E402
from bench_scans import BenchScan, take  # noqa: E402
from marked import provenance, rows_between_marks, write_between_marks  # noqa: E402
from synthetic_scans import facing_pose  # noqa: E402

from picoradar.registration import Model, pose_error, prepare_model, register  # noqa: E402
from picoradar.registration.least_squares import plane_rows  # noqa: E402
from picoradar.registration.se3 import inverse, pose, rotation_from_vector, transform  # noqa: E402
from picoradar.registration.solution import PoseError  # noqa: E402
from picoradar.sim import SimulatedBench  # noqa: E402
from picoradar.sim.physics import (  # noqa: E402
    BONE_WET,
    SOCKET_AXIS,
    SOCKET_CENTRE_MM,
    Scene,
    Target,
    add_tissue,
    decorate,
    hip,
)

NAME = "benchmarks/registration/through_instrument.py"
TISSUE_SHARE = 1.4
"""Area of the clumps over that of the socket; they overlap, so that about 42 % of the points lie off the bone."""

HEAD = [
    "| bone | scans | points off the bone | right | rotation, deg: median / worst right one "
    "| socket centre, mm: the same | floor of the rotation, deg | verdict pass | of these wrong | CPU ms |",
    "|---|---|---|---|---|---|---|---|---|---|",
]
LESS = ("covariances alone", "responses alone", "neither")
WORTH_HEAD = ["| bone | covariances and responses | " + " | ".join(LESS) + " |", "|---|---|---|---|---|"]
WORTH = "What the ranging's covariances and responses are worth: share right, median rotation and shift of all scans."

SCAN = {"mode": "window", "rows": 40, "columns": 40}


class Operation:
    """What stands before the bench: a wet hip bone under tissue and blood, at a pose drawn from the seed.

    The shipped bone also has cartilage, a fat pad and a clot in its fossa, and two retractors beside it.
    """

    def __init__(self, mesh: str | None, seed: int, distance_mm: float = 900.0) -> None:
        self._rng = np.random.default_rng([seed, 6])
        if mesh is None:
            body, self.centre, axis = hip(), np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS)
            self.vertices, self.faces = body.vertices, body.faces
            self._decorated = decorate(body, self.centre, axis)
        else:
            local, self.faces, _ = _loaded(mesh)
            frame = pose(rotation_from_vector(self._rng.normal(size=3)), self._rng.normal(size=3) * 100.0)
            self.vertices, self.centre, axis = transform(frame, local), frame[:3, 3], frame[:3, 2]
            wet = np.zeros(len(self.faces), dtype=np.int64)
            self._decorated = Target("bone", self.vertices, self.faces, (BONE_WET,), wet)
        self._model_from_scanner = facing_pose(axis, self.centre, self._rng, distance_mm)

    def __call__(self, bench: SimulatedBench) -> tuple[np.ndarray, np.ndarray]:
        """Put the bone before the scanner; return the bare model."""
        bench.target = add_tissue(self._decorated, self.centre, TISSUE_SHARE, self._rng)
        bench.scene = Scene(bench.target, inverse(self._model_from_scanner))
        bench.optics.aim_at(bench.scene)
        return self.vertices, self.faces


_MESHES: dict[str, tuple[np.ndarray, np.ndarray, float]] = {}


def _loaded(mesh: str) -> tuple[np.ndarray, np.ndarray, float]:
    if mesh not in _MESHES:
        _MESHES[mesh] = scenes.load_real(mesh)
    return _MESHES[mesh]


@dataclass(frozen=True)
class Trial:
    """One scan and what came of it.

    Attributes
    ----------
    off_bone : float
        Share of the points more than 1 mm off the bare bone at the true pose.
    floor_deg : float
        Rotation error with the bone points known (Cramer-Rao).
    without : dict
        Errors of the same scan when less is given (`LESS`).
    """

    seed: int
    points: int
    off_bone: float
    floor_deg: float
    rotation_deg: float
    centre_mm: float
    predicted_deg: float
    verdict: str
    ms: float
    without: dict[str, PoseError]

    @property
    def right(self) -> bool:
        """Within 1 deg and 1 mm."""
        return self.rotation_deg < 1.0 and self.centre_mm < 1.0


def floor_deg(scan: BenchScan, model: Model) -> float:
    """Root mean square rotation error (Cramer-Rao) with the bone points known and weighted rightly."""
    here = scan.in_model()
    closest = model.closest(here)
    bone = np.abs(closest.signed_mm) < 1.0
    rotated = closest.normals @ scan.truth[:3, :3]
    variance = np.einsum("ni,nij,nj->n", rotated, scan.cloud.covariance_mm2, rotated)
    rows = plane_rows(here[bone], closest.normals[bone], here[bone].mean(axis=0)) / np.sqrt(variance[bone])[:, None]
    return float(np.degrees(np.sqrt(np.trace(np.linalg.inv(rows.T @ rows)[:3, :3]))))


def trial(seed: int, mesh: str | None) -> Trial:
    """Scan and register."""
    before = Operation(mesh, seed)
    scan, centre = take(seed, dress=before, scan=SCAN), before.centre
    model = prepare_model(scan.vertices, scan.faces)
    cloud = scan.cloud
    began = time.process_time()
    found = register(
        cloud.points_mm,
        model,
        covariance=cloud.covariance_mm2,
        response_mv=cloud.response_mv,
        grid=cloud.grid,
        range_bias_mm=0.1,
    )
    ms = (time.process_time() - began) * 1e3
    less = [{"covariance": cloud.covariance_mm2}, {"response_mv": cloud.response_mv}, {}]
    others = [register(cloud.points_mm, model, grid=cloud.grid, **given, range_bias_mm=0.1) for given in less]
    error, *lesser = (pose_error(r.model_from_scanner, scan.truth, centre) for r in (found, *others))
    off_bone = float(np.mean(np.abs(model.closest(scan.in_model()).signed_mm) > 1.0))
    return Trial(
        seed, len(cloud), off_bone, floor_deg(scan, model), error.rotation_deg, error.translation_mm,
        found.predicted_rotation_deg, found.verdict, ms, dict(zip(LESS, lesser, strict=True)),
    )  # fmt: skip


def given(name: str, trials: list[Trial]) -> str:
    """One row of the table of what covariances and responses are worth."""
    errors = [[(t.rotation_deg, t.centre_mm) for t in trials]]
    errors += [[(t.without[way].rotation_deg, t.without[way].translation_mm) for t in trials] for way in LESS]
    cells = []
    for way in np.array(errors):
        right = np.mean((way[:, 0] < 1.0) & (way[:, 1] < 1.0))
        cells.append(f"{right:.0%}, {np.median(way[:, 0]):.2f} deg, {np.median(way[:, 1]):.2f} mm")
    return f"| {name} | " + " | ".join(cells) + " |"


def summary(name: str, trials: list[Trial]) -> str:
    """One row of the table."""
    right = [t for t in trials if t.right]
    passed = [t for t in trials if t.verdict == "pass"]
    wrong_passes = sum(not t.right for t in passed)
    return (
        f"| {name} | {len(trials)} | {np.median([t.off_bone for t in trials]):.0%} | {len(right)} "
        f"| {np.median([t.rotation_deg for t in right]):.2f} / {max(t.rotation_deg for t in right):.2f} "
        f"| {np.median([t.centre_mm for t in right]):.2f} / {max(t.centre_mm for t in right):.2f} "
        f"| {np.median([t.floor_deg for t in trials]):.2f} | {len(passed)} | {wrong_passes} "
        f"| {np.median([t.ms for t in trials]):.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=20)
    parser.add_argument("--seed-base", type=int, default=6000, help="seed of the first scan")
    parser.add_argument(
        "--mesh", action="append", default=[], help="another hip bone than the shipped one; may be repeated"
    )
    parser.add_argument(
        "--write", action="store_true", help="put the rows into docs/registration.md; other bones' rows stay"
    )
    options = parser.parse_args()
    rows = rows_between_marks("registration.md", NAME, 10)
    worth = rows_between_marks("registration.md", NAME, 5)
    for mesh in options.mesh or [None]:
        name = "shipped hip" if mesh is None else Path(mesh).stem
        trials = []
        for seed in range(options.seed_base, options.seed_base + options.scans):
            trials.append(trial(seed, mesh))
            print(name, "right" if trials[-1].right else "MISS", trials[-1], flush=True)
        rows[name], worth[name] = summary(name, trials), given(name, trials)
        print(rows[name], worth[name], sep="\n", flush=True)
        if options.write:
            lines = [*HEAD, *rows.values(), "", WORTH, "", *WORTH_HEAD, *worth.values()]
            write_between_marks("registration.md", NAME, [provenance(), "", *lines])


if __name__ == "__main__":
    main()
