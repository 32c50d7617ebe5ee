"""Whole scans over the edge of a plate before another one: are both ranges there, and are they true?

    python benchmarks/two_echoes.py [--scans 5] [--seed 5]

The scan goes in steps of 0.1 mm over an edge at which some of the light of each spot goes past the front plate. Both
plates stand at right angles to the middle beam, so z of the points is known. Judged are places whose two responses are
above 15 mV: the walk correction of the shipped calibration reaches down to about 10 mV.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import tempfile
from pathlib import Path

import numpy as np
import trimesh

from picoradar.instrument.cli.main import run
from picoradar.instrument.recording import Cloud, Recording

FRONT_MM = 900.0
EDGE_MM = 0.2  # beside the middle beam
SURE_MV = 15.0
GAPS_MM = (20.0, 35.0, 60.0, 80.0, 120.0)


def over_an_edge(folder: Path, gap_mm: float, seed: int) -> list[str]:
    """Make the two plates, and return the arguments of a scan over the edge (without mode and recording)."""
    corners, faces = [], []
    for k, (left, right, height) in enumerate(((-100.0, EDGE_MM, 0.0), (EDGE_MM, 100.0, gap_mm))):
        corners += [[x, y, height] for x, y in ((left, -60), (right, -60), (right, 60), (left, 60))]
        faces += [[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
    model = folder / "plates.stl"
    trimesh.Trimesh(corners, faces, process=False).export(model)
    where = ["--target", str(model), "--target-pose", f"0,0,{FRONT_MM:g},0,0,0"]
    return ["scan", *where, "--grid", "4x16", "--step-mm", "0.1", "--estimator", "template", "--seed", str(seed)]


def sure(cloud: Cloud) -> Cloud:
    """Return the places with two echoes that are both bright enough to be judged."""
    return cloud.where(cloud.two_echoes & (cloud.response_mv > SURE_MV) & (cloud.last_response_mv > SURE_MV))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=5)
    parser.add_argument("--seed", type=int, default=5)
    asked = parser.parse_args()
    print("mode   gap mm | places two judged | first: bias   sd  err^2/stated^2 | last: bias   sd  err^2/stated^2")
    for mode in ("sweep", "window"):
        for gap_mm in GAPS_MM:
            clouds = [_scan(mode, gap_mm, asked.seed + k) for k in range(asked.scans)]
            judged = [sure(cloud) for cloud in clouds]
            first = np.concatenate([one.points_mm[:, 2] - FRONT_MM for one in judged])
            last = np.concatenate([one.last_points_mm[:, 2] - FRONT_MM - gap_mm for one in judged])
            stated = np.concatenate([one.range_variance_mm2 for one in judged])
            of_last = np.concatenate([one.last_range_variance_mm2 for one in judged])
            two = sum(int(cloud.two_echoes.sum()) for cloud in clouds)
            figures = f"{mode:6} {gap_mm:6.0f} | {sum(map(len, clouds)):6d} {two:3d} {len(first):6d} "
            for error, variance in ((first, stated), (last, of_last)) if len(first) else ():
                figures += f"| {error.mean():11.3f} {error.std():5.3f} {np.mean(error**2 / variance):14.2f} "
            print(figures, flush=True)


def _scan(mode: str, gap_mm: float, seed: int) -> Cloud:
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(io.StringIO()):
        path = Path(name) / "scan.db"
        if run([*over_an_edge(Path(name), gap_mm, seed), "--mode", mode, "-o", str(path), "--json"]):
            raise RuntimeError("the scan failed")
        with Recording.open(path) as recording:
            return recording.cloud().with_range()


if __name__ == "__main__":
    main()
