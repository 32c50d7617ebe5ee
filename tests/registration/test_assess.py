"""From residuals to evidence: motions that nothing holds, and points inside bone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration import ErrorBudget, RobustSettings
from picoradar.registration.robust import register_robust
from picoradar.registration.scan import NoiseModel, Scan, checked_scan
from picoradar.registration.settings import TrustSettings
from picoradar.registration.solution import Solution
from picoradar.registration.trust.assess import RegistrationRequest, assess
from picoradar.registration.trust.covariance import inverse_information

REQUEST = RegistrationRequest(targets=None, tolerance=registration.Tolerance(), budget=ErrorBudget(range_bias_mm=0.0))
SETTINGS = RobustSettings()


def test_a_motion_that_nothing_holds_has_a_metre_of_standard_deviation() -> None:
    """At the points' radius, where it turns; the others have one over their information."""
    scale = np.array([0.1] * 3 + [1.0] * 3)
    found = inverse_information(np.diag([0.0, 400.0, 100.0, 4.0, 1.0, 0.0]), scale, TrustSettings().free_mm)
    np.testing.assert_allclose(np.diag(found), [1e4, 1 / 400, 1 / 100, 1 / 4, 1.0, 1e6])


@pytest.fixture(scope="module")
def solved(socket: registration.Model, scan_of: Callable[..., Any]) -> tuple[Scan, Solution]:
    scan = checked_scan(scan_of(socket, 0, n=30, noise_mm=0.05).points)
    return scan, register_robust(scan, socket, None, None, np.zeros((0, 4)), SETTINGS)


@pytest.mark.parametrize(
    ("noise_mm", "depth_mm", "verdict"),
    [(0.02, 0.99, "pass"), (0.02, 1.01, "fail"), (0.5, 1.99, "pass"), (0.5, 2.01, "fail")],
)
def test_a_point_lies_inside_bone_by_four_standard_deviations_of_a_quarter_of_a_millimetre_or_more(
    solved: tuple[Scan, Solution], noise_mm: float, depth_mm: float, verdict: str
) -> None:
    """Models err, too: of an instrument without noise four sigmas would be a tenth of a millimetre."""
    scan, solution = solved
    few = np.arange(len(scan)) % 20 == 0
    signed = np.where(few, -depth_mm, solution.closest.signed_mm)
    sunk = replace(
        solution,
        closest=replace(solution.closest, signed_mm=signed),
        inliers=solution.inliers & ~few,
        noise=NoiseModel(noise_mm, noise_mm, 0.0),
    )
    found = assess(scan, sunk, REQUEST, [], SETTINGS)
    assert found.verdict == verdict, found.reasons
    assert any("inside bone" in reason for reason in found.reasons) == (verdict == "fail")


def test_a_common_range_error_moves_the_targets_as_far_as_is_said(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    """Every point 0.3 mm farther along its beam, registered again; patches that do not fit the model must not count."""
    scan = scan_of(socket, 1, noise_mm=0.05)
    targets = np.array([[0.0, 0.0, 0.0], [30.0, -10.0, 20.0]])
    error_mm = 0.3
    patchy = scan.points + 0.3 * np.sin(scan.points[:, :1] / 4.0) * beams_of(scan.points)
    for points in (scan.points, patchy):
        here, there = (
            registration.register(
                points + far * beams_of(points), socket, start=scan.truth, targets=targets, range_bias_mm=error_mm
            )
            for far in (0.0, error_mm)
        )
        moved = [
            registration.se3.transform(found.model_from_scanner @ np.linalg.inv(scan.truth), targets)
            for found in (here, there)
        ]
        for target, shift in zip(here.targets, np.linalg.norm(moved[1] - moved[0], axis=1), strict=True):
            assert target.bias_mm == pytest.approx(shift, rel=0.25)
            assert target.stated_mm == target.p95_mm + 2.0 * target.bias_mm


def beams_of(points: np.ndarray) -> np.ndarray:
    return np.asarray(points / np.linalg.norm(points, axis=1)[:, None])


def test_an_error_that_nobody_knows_is_not_a_number_and_never_a_pass(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    scan = scan_of(socket, 0)
    unknown = registration.register(scan.points, socket, start=scan.landmarks)
    known = registration.register(scan.points, socket, start=scan.landmarks, range_bias_mm=0.0)
    assert (unknown.verdict, known.verdict) == ("caution", "pass")
    assert np.isnan(unknown.targets[0].bias_mm)
    assert unknown.to_dict()["targets"][0]["stated_mm"] is None
    assert known.targets[0].p95_mm == unknown.targets[0].p95_mm
    assert known.targets[0].bias_parts_mm["mirror scale"] > 0.0
    assert "range" not in known.targets[0].bias_parts_mm
    assert len(unknown.reasons) == 1


@pytest.mark.parametrize("wrong", [-0.1, float("nan"), float("inf"), 101.0])
def test_a_common_range_error_is_a_deviation_in_mm(
    socket: registration.Model, scan_of: Callable[..., Any], wrong: float
) -> None:
    with pytest.raises(registration.RegistrationError, match="range_bias_mm"):
        registration.register(scan_of(socket, 0).points, socket, range_bias_mm=wrong)
