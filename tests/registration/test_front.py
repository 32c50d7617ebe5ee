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


def uneven(scan: Any, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points whose range noise is four times larger on one half of the raster, and responses that say so."""
    rng = np.random.default_rng([seed, 9])
    weak = scan.grid[:, 1] < 20
    beams = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
    points = scan.points + beams * np.where(weak, rng.normal(0.0, 0.6, len(weak)), 0.0)[:, None]
    return points, np.where(weak, 12.0, 50.0)


def test_covariances_and_responses_are_carried_into_the_weights(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    """Both bring the pose nearer to the truth than points alone, over several scans."""
    errors: dict[str, list[float]] = {"points": [], "responses": [], "covariances": []}
    for seed in range(12):  # of four the rms is good to a fifth only, and it is a fifth that is asked for
        scan = scan_of(socket, seed, noise_mm=0.15)
        points, response = uneven(scan, seed)
        beams = points / np.linalg.norm(points, axis=1, keepdims=True)
        sigma = np.where(response < 20.0, np.hypot(0.15, 0.6), 0.15)
        covariance = sigma[:, None, None] ** 2 * np.einsum("ni,nj->nij", beams, beams) + 0.02**2 * np.eye(3)
        given: dict[str, dict[str, Any]] = {
            "points": {},
            "responses": {"response_mv": response},
            "covariances": {"covariance": covariance},
        }
        for name, options in given.items():
            found = registration.register(points, socket, start=scan.truth, grid=scan.grid, **options)
            error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
            errors[name].append(error.rotation_deg)
    rms = {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in errors.items()}
    assert rms["covariances"] < 0.8 * rms["points"]
    assert rms["responses"] < 0.8 * rms["points"]
