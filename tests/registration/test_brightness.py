"""Points that are darker than bone take no part at the end: thin films that no range can tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration import RobustSettings
from picoradar.registration.robust import brightness, register_robust
from picoradar.registration.scan import Scan, checked_scan
from picoradar.registration.solution import Solution


def film_of_blood(scan: Any, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of which 35 % lie under a film of 0.4 mm, the responses, and where the film is."""
    rng = np.random.default_rng([seed, 11])
    points, film = scan.points.copy(), np.zeros(len(scan.points), dtype=bool)
    while film.mean() < 0.35:
        film |= np.linalg.norm(points - points[rng.integers(len(points))], axis=1) < rng.uniform(3.0, 6.0)
    distance = np.linalg.norm(points, axis=1)
    points[film] *= (1.0 - 0.4 / distance[film])[:, None]
    return points, np.where(film, 16.0, 45.0) * rng.normal(1.0, 0.05, len(points)), film


@pytest.fixture(scope="module")
def given(socket: registration.Model, scan_of: Callable[..., Any]) -> list[dict[str, Any]]:
    """Three scans registered with and without their responses."""
    out = []
    for seed in range(3):
        scan = scan_of(socket, seed, noise_mm=0.2)
        points, response, film = film_of_blood(scan, seed)
        covariance = np.broadcast_to(0.2**2 * np.eye(3), (len(points), 3, 3))
        options: dict[str, Any] = {"start": scan.truth, "grid": scan.grid, "covariance": covariance}
        found = [registration.register(points, socket, **options, **kw) for kw in ({}, {"response_mv": response})]
        out.append({"scan": scan, "film": film, "without": found[0], "with": found[1]})
    return out


def test_a_dark_film_is_left_out(given: list[dict[str, Any]]) -> None:
    """Almost: these responses do not fall with the cosine, so that a few points of steep walls look bright."""
    for case in given:
        assert case["with"].inliers[case["film"]].mean() < 0.05
        assert case["with"].inliers[~case["film"]].mean() > 0.8
        assert case["without"].inliers[case["film"]].mean() > 0.3


def test_the_pose_comes_nearer_to_the_truth(given: list[dict[str, Any]]) -> None:
    errors = [
        [
            registration.pose_error(case[way].model_from_scanner, case["scan"].truth, np.zeros(3)).translation_mm
            for way in ("without", "with")
        ]
        for case in given
    ]
    without, with_responses = np.sqrt(np.mean(np.square(errors), axis=0))
    assert with_responses < 0.5 * without


def test_of_a_large_scan_three_thousand_bright_points_are_searched_with(
    socket: registration.Model, scan_of: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """About: every second row and column; the last fit takes all."""
    scan = checked_scan(scan_of(socket, 1, n=110).points)
    solution = register_robust(scan, socket, None, None, np.zeros((0, 4)), RobustSettings())
    response = np.where(np.arange(len(scan)) % 10, 40.0, 1.0)
    searched: list[int] = []

    def counted(points: Scan, *_: object) -> Solution:
        searched.append(len(points))
        return solution

    monkeypatch.setattr(brightness, "register_near", counted)
    found = brightness.without_dark_points(
        replace(scan, response_mv=response), socket, solution, np.zeros((0, 4)), RobustSettings()
    )
    assert len(scan) > 8000
    assert 2500 < searched[0] < 3500
    assert found.inliers.sum() > 0.8 * len(scan)


@pytest.mark.parametrize("response", ["even", "of no meaning"])
def test_responses_that_tell_nothing_do_no_harm(
    socket: registration.Model, scan_of: Callable[..., Any], response: str
) -> None:
    scan = scan_of(socket, 1, noise_mm=0.2)
    count = len(scan.points)
    spread = 0.0 if response == "even" else 1.0
    amplitudes = 40.0 * np.exp(spread * np.random.default_rng(0).normal(size=count))
    covariance = np.broadcast_to(0.2**2 * np.eye(3), (count, 3, 3))
    found = registration.register(scan.points, socket, grid=scan.grid, covariance=covariance, response_mv=amplitudes)
    error = registration.pose_error(found.model_from_scanner, scan.truth, np.zeros(3))
    assert error.rotation_deg < 1.0
    assert error.translation_mm < 0.2
