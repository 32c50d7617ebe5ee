"""The front door refuses what it cannot use before the search takes its time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import registration


@pytest.mark.parametrize(
    ("targets", "message"),
    [
        (np.zeros((3, 2)), r"finite \(M, 3\)"),
        ([{"name": "rim"}], "position"),
        ([{"name": "rim", "position": [0.0, float("nan"), 1.0]}], "rim is at .*nan.*finite"),
        ([{"name": "rim", "position": [0.0, 1.0]}], "position"),
    ],
)
def test_bad_targets_are_refused_before_the_search(
    socket: registration.Model, scan_of: Callable[..., Any], targets: Any, message: str
) -> None:
    scan = scan_of(socket, 0)
    began = time.perf_counter()
    with pytest.raises(registration.RegistrationError, match=message):
        registration.register(scan.points, socket, targets=targets)
    assert time.perf_counter() - began < 0.02


def test_the_dissertations_method_refuses_what_it_does_not_know(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    scan = scan_of(socket, 0, n=10)
    with pytest.raises(registration.StartError, match="needs a start"):
        registration.register(scan.points, socket, method="dissertation")
    region = {"center": [0.0, 0.0, -29.6], "radius_mm": 12.0}
    with pytest.raises(registration.RegistrationError, match="no excluded regions"):
        registration.register(scan.points, socket, start=scan.truth, method="dissertation", exclude=[region])


def test_the_dissertations_method_takes_the_noise_as_given(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    scan = scan_of(socket, 3, n=16)
    settings = registration.DissertationSettings(max_iterations=30, suppression_runs=0)
    small, large = (
        registration.register(
            scan.points, socket, start=scan.truth, method="dissertation", settings=settings, noise_mm=noise
        )
        for noise in (0.4, 0.8)
    )
    assert (small.noise_mm, large.noise_mm) == (0.4, 0.8)
    assert large.predicted_rotation_deg > 1.2 * small.predicted_rotation_deg
