"""The front door refuses what it cannot use before the search takes its time."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from picoradar import registration


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
    socket: registration.Model,
    scan_of: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    targets: Any,
    message: str,
) -> None:
    def searched(*_arguments: Any, **_options: Any) -> None:
        pytest.fail("the search has begun")

    scan = scan_of(socket, 0)
    monkeypatch.setattr(sys.modules["picoradar.registration.register.work"], "register_robust", searched)
    with pytest.raises(registration.RegistrationError, match=message):
        registration.register(scan.points, socket, targets=targets)


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


@pytest.mark.parametrize("direction", ["along", "across"])
@pytest.mark.parametrize("size_mm", [1e-15, 0.2])
def test_covariances_of_rank_one_are_taken(
    socket: registration.Model, scan_of: Callable[..., Any], direction: str, size_mm: float
) -> None:
    scan = scan_of(socket, 0, n=30)
    axis = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
    if direction == "across":
        axis = np.cross(axis, [1.0, 0.0, 0.0])
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    covariance = size_mm**2 * np.einsum("ni,nj->nij", axis, axis)
    found = registration.register(scan.points, socket, grid=scan.grid, covariance=covariance)
    assert np.isfinite(found.covariance).all()


def test_a_covariance_that_is_none_is_refused(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 0, n=12)
    lopsided = np.tile(0.04 * np.eye(3), (len(scan.points), 1, 1))
    lopsided[:, 0, 2] = -50.0
    for covariance, said in ((lopsided, "not symmetric"), (0.0 * lopsided, "none at all"), (-lopsided, "symmetric")):
        with pytest.raises(registration.PointsError, match=said):
            registration.register(scan.points, socket, covariance=covariance)


@pytest.mark.parametrize("noise_mm", [0.0, -1.0, 1e-30, 1e200, float("nan")])
def test_a_noise_that_no_instrument_has_is_refused(
    socket: registration.Model, scan_of: Callable[..., Any], noise_mm: float
) -> None:
    with pytest.raises(registration.RegistrationError, match="noise_mm"):
        registration.register(scan_of(socket, 0, n=12).points, socket, noise_mm=noise_mm)


def test_a_start_beside_a_large_face_is_refused(scan_of: Callable[..., Any], socket: registration.Model) -> None:
    """The middle of the face is near enough, but all of it lies on another side."""
    corners = np.array([[120.0, -150.0, 0.0], [120.0, 150.0, 0.0], [400.0, 0.0, 0.0]])
    triangle = registration.prepare_model(corners, np.array([[0, 2, 1]]))
    start = np.diag([1.0, -1.0, -1.0, 1.0])
    start[2, 3] = 900.0
    with pytest.raises(registration.StartError, match="beside the model"):
        registration.register(scan_of(socket, 0, n=12).points, triangle, start=start)
