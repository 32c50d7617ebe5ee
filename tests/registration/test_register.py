"""The front door: registration of simulated scans, its JSON, and refusals."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from picoradar import registration

CONTRACT = {
    "model_from_scanner", "verdict", "reasons", "rms_mm", "mean_mm", "max_mm", "nlse", "inliers", "points", "targets",
    "predicted_rotation_deg", "weak_directions", "rivals",
}  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_a_clean_scan_with_landmarks_ends_well_inside_a_degree_and_a_millimetre(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    scan = scan_of(socket, seed)
    found = registration.register(scan.points, socket, start=scan.landmarks, range_bias_mm=0.1)
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 1.0
    assert error.translation_mm < 0.2
    assert found.verdict == "pass"


def test_the_dissertations_method_registers_and_improves_monotonically(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    scan = scan_of(socket, 1, n=16)
    settings = registration.DissertationSettings(max_iterations=60, suppression_runs=2)
    found = registration.register(
        scan.points, socket, start=scan.landmarks, method="dissertation", settings=settings, range_bias_mm=0.1
    )
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 2.0
    assert error.translation_mm < 0.5
    first_run = [entry.rms_mm for entry in found.history if entry.stage == "icp"]
    assert (np.diff(first_run) <= 1e-9).all()


def test_the_result_is_json_with_the_keys_of_the_contract(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    scan = scan_of(socket, 2, n=20)
    found = registration.register(
        scan.points, socket, start=scan.truth, targets=[{"name": "fossa", "position": [0, 0, -29]}], range_bias_mm=0.1
    )
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert set(data) >= CONTRACT
    assert data["targets"][0]["name"] == "fossa"
    assert set(data["targets"][0]) >= {"name", "position", "rms_mm", "p95_mm", "bias_mm"}
    assert data["inliers"] == int(found.inliers.sum())
    assert found.covariance.shape == (6, 6)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((0, 3)), "empty"),
        (np.arange(15.0).reshape(5, 3) ** 2 + 100, "at least 6"),
        (np.outer(np.arange(1.0, 20.0), [1.0, 2.0, 3.0]), "one line"),
        (np.full((10, 3), np.nan), "NaN"),
        (np.ones((10, 2)), "shape"),
    ],
)
def test_bad_points_are_refused(socket: registration.Model, points: np.ndarray, message: str) -> None:
    with pytest.raises(registration.RegistrationError, match=message):
        registration.register(points, socket, start=np.eye(4), range_bias_mm=0.1)


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (np.diag([2.0, 2, 2, 1]), "scale"),
        (np.diag([-1.0, 1, 1, 1]), "mirrors"),
        (np.eye(3), "4x4"),
        ("everywhere", "'any'"),
        ([{"scanner": [0, 0, 1]}], "model"),
    ],
)
def test_bad_starts_are_refused(
    socket: registration.Model, scan_of: Callable[..., Any], start: Any, message: str
) -> None:
    with pytest.raises(registration.StartError, match=message):
        registration.register(scan_of(socket, 0, n=10).points, socket, start=start, range_bias_mm=0.1)


def test_importing_the_package_loads_no_heavy_module() -> None:
    code = "import sys, registration; print([m for m in ('matplotlib', 'trimesh', 'igl') if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
