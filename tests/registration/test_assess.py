"""From residuals to evidence: motions that nothing holds, and points inside bone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration import RobustSettings
from picoradar.registration.robust import register_robust
from picoradar.registration.scan import NoiseModel, Scan, checked_scan
from picoradar.registration.settings import TrustSettings
from picoradar.registration.solution import Solution
from picoradar.registration.trust.assess import RegistrationRequest, assess, pose_covariance

REQUEST = RegistrationRequest(targets=None, tolerance=registration.Tolerance(), range_bias_mm=0.0)
SETTINGS = RobustSettings()


def test_a_motion_that_nothing_holds_has_a_metre_of_standard_deviation() -> None:
    """At the points' radius, where it turns; the others have one over their information."""
    found = pose_covariance(np.diag([0.0, 400.0, 100.0, 4.0, 1.0, 0.0]), 10.0, TrustSettings().free_mm)
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
