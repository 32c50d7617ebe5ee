"""Landmarks that a registration begins at, and what is said of those that are wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.se3 import rotation_angle_deg
from tests.registration.conftest import SimulatedScan

ScanOf = Callable[..., SimulatedScan]
Marks = list[dict[str, Any]]


def marked(scan: SimulatedScan, count: int = 5) -> Marks:
    """Pairs clicked to 2 mm an axis, spread over the cloud."""
    rng = np.random.default_rng(5)
    chosen = [int(np.argmax(scan.points @ [np.cos(a), np.sin(a), 0.0])) for a in 2 * np.pi * np.arange(count) / count]
    turn, shift = scan.truth[:3, :3], scan.truth[:3, 3]
    return [
        {"scanner": scan.points[i], "model": turn @ scan.points[i] + shift + rng.normal(0, 2.0, 3), "name": f"rim {k}"}
        for k, i in enumerate(chosen)
    ]


def registered(model: registration.Model, scan: SimulatedScan, marks: Marks) -> tuple[registration.Registration, float]:
    found = registration.register(scan.points, model, start=marks, grid=scan.grid, range_bias_mm=0.1)
    return found, float(rotation_angle_deg(found.model_from_scanner[:3, :3] @ scan.truth[:3, :3].T))


def test_good_landmarks_are_not_spoken_of(socket: registration.Model, scan_of: ScanOf) -> None:
    scan = scan_of(socket, 1)
    found, off_deg = registered(socket, scan, marked(scan))
    assert off_deg < 0.5
    assert found.verdict == "pass"
    assert not any("andmark" in reason or "rim" in reason for reason in found.reasons)


def test_a_landmark_that_was_clicked_elsewhere_is_named_and_does_not_decide(
    socket: registration.Model, scan_of: ScanOf
) -> None:
    scan = scan_of(socket, 2)
    marks = marked(scan)
    marks[3]["model"] = marks[3]["model"] + [0.0, 25.0, 10.0]
    found, off_deg = registered(socket, scan, marks)
    assert off_deg < 0.5
    assert found.verdict == "pass"
    assert "rim 3" in found.reasons[-1]


def test_exchanged_landmarks_are_named(socket: registration.Model, scan_of: ScanOf) -> None:
    scan = scan_of(socket, 3)
    marks = marked(scan)
    marks[1]["model"], marks[2]["model"] = marks[2]["model"], marks[1]["model"]
    found, off_deg = registered(socket, scan, marks)
    assert off_deg < 0.5
    assert any("rim 1 and rim 2 seem to be exchanged" in reason for reason in found.reasons)


@pytest.mark.parametrize("seed", range(2))
def test_landmarks_that_lead_nowhere_are_left_for_a_search_from_anywhere(
    socket: registration.Model, scan_of: ScanOf, seed: int
) -> None:
    """A list of another scan: all pairs agree with each other, and none with this cloud."""
    scan = scan_of(socket, 10 + seed)
    other_way = np.diag([1.0, -1.0, -1.0])
    marks = [{**m, "model": other_way @ m["model"] + [0.0, 0.0, -60.0]} for m in marked(scan)]
    found, off_deg = registered(socket, scan, marks)
    assert off_deg < 0.5
    assert found.verdict == "caution"
    assert "without them, from anywhere" in found.reasons[0]


def test_where_nothing_is_found_from_anywhere_either_it_fails(socket: registration.Model) -> None:
    rng = np.random.default_rng(6)
    points = rng.normal(size=(800, 3)) * [15.0, 15.0, 6.0] + [0.0, 0.0, 900.0]
    marks = [{"scanner": points[k], "model": points[k] - [0.0, 0.0, 900.0], "name": str(k)} for k in range(4)]
    try:
        verdict = registration.register(points, socket, start=marks, range_bias_mm=0.1).verdict
    except registration.RegistrationError:
        return
    assert verdict == "fail"
