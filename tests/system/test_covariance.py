"""The covariance that a point carries is that of its true error: range, pointing and lever arm; scan, file, export."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.recording import Recording


@pytest.mark.parametrize(("options", "grid"), [(("--estimator", "template"), "10x40"), (("--mode", "window"), "12x40")])
def test_points_miss_a_tilted_plate_by_what_their_covariance_says(
    options: tuple[str, str], grid: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, exported = tmp_path / "scan.db", tmp_path / "cloud.npz"
    pose = ("--target", "plate", "--target-pose", "0,0,900,50,0,0")
    assert run(["scan", *pose, *options, "--grid", grid, "--seed", "5", "-o", str(path), "--json"]) == 0
    model_from_scanner = np.array(json.loads(capsys.readouterr().out)["truth"]["model_from_scanner"])
    assert run(["export", str(path), "-o", str(exported)]) == 0
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    with np.load(exported) as held:
        points, covariance, variance = held["points_mm"], held["covariance_mm2"], held["range_variance_mm2"]
    np.testing.assert_array_equal(covariance, cloud.covariance_mm2)
    normal, height = model_from_scanner[2, :3], model_from_scanner[2, 3]
    off = points @ normal + height  # of the plate, whose plane is z = 0 in its own frame
    chi2 = np.mean(off**2 / np.einsum("i,nij,j->n", normal, covariance, normal))
    assert chi2 == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(points)))
    if "template" in options:  # here the mirrors' share is as great as that of the range: without it the sum is off
        assert np.mean(off**2 / (variance * normal[2] ** 2)) > 1.5
