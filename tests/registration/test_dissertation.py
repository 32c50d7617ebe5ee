"""The dissertation's method: its table 4.1, the stages of its history, and what elimination leaves."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.classic import DissertationSettings, register_dissertation
from picoradar.registration.model import Surface
from picoradar.registration.se3 import inverse, pose, rotation_from_vector, transform


@pytest.fixture(scope="module")
def prism() -> Surface:
    """Two sloping faces over 40 x 40 mm, ridge 40 mm high along x: 3321 points (section 4.1.1)."""
    x, y = np.meshgrid(np.linspace(-20, 20, 41), np.linspace(-20, 20, 81), indexing="ij")
    a = (np.arange(40)[:, None] * 81 + np.arange(80)).ravel()
    faces = np.concatenate([np.stack([a, a + 81, a + 82], axis=1), np.stack([a, a + 82, a + 1], axis=1)])
    return Surface(np.stack([x.ravel(), y.ravel(), 40.0 - 2.0 * np.abs(y).ravel()], axis=1), faces)


def test_table_4_1_ends_as_the_dissertation_says_after_40_iterations(prism: Surface) -> None:
    """Its means over 0 to 15 deg are 2.7e-6 deg and 1.2e-5 mm; 15 deg about the ridge is the hardest of the four."""
    centre = prism.vertices.mean(axis=0)
    turn = rotation_from_vector(np.radians([15.0, 0.0, 0.0]))
    away = pose(turn, centre - turn @ centre)
    settings = DissertationSettings(40, 1e-18, suppression_runs=0, outlier_threshold_mm=None)
    found = register_dissertation(transform(away, prism.vertices), prism, np.eye(4), settings)
    error = registration.pose_error(found.model_from_scanner, inverse(away), centre)
    assert error.rotation_deg < 2.7e-6
    assert error.translation_mm < 1.2e-5
    assert found.history[0].rms_mm == pytest.approx(3.0, abs=0.5)


def test_the_history_tells_the_stages(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 2, n=14)
    points = scan.points.copy()
    points[::5] *= 0.995
    settings = DissertationSettings(max_iterations=15, tolerance_mm2=0.0, suppression_runs=3)
    found = register_dissertation(points, socket.surface, scan.truth, settings)
    stages = [(name, len(list(group))) for name, group in groupby(entry.stage for entry in found.history)]
    assert [name for name, _ in stages] == ["icp", "minima suppression", "outlier elimination"]
    assert stages[1][1] <= 3 * 15
    used = [entry.points for entry in found.history]
    assert used == sorted(used, reverse=True)
    left = socket.surface.distances(transform(found.model_from_scanner, points[found.used]))
    assert left.max() <= settings.outlier_threshold_mm  # type: ignore[operator]


def test_the_same_seed_gives_the_same_bits(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 2, n=12)
    settings = DissertationSettings(max_iterations=10, suppression_runs=2)
    first, second = (register_dissertation(scan.points, socket.surface, scan.truth, settings) for _ in range(2))
    assert first.model_from_scanner.tobytes() == second.model_from_scanner.tobytes()
