"""Weakly held rotations: the beam fit begins again from both sides, and what it finds there counts as uncertainty."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.refine import BeamFit, BeamFitter, along_weak_mode, alternatives_of, dispersion
from picoradar.registration.scan import NoiseModel, Scan, checked_scan
from picoradar.registration.se3 import inverse, pose, rotation_angle_deg, rotation_from_vector
from picoradar.registration.settings import RobustSettings, WeakModeSettings
from picoradar.registration.solution import Alternative

WALK = WeakModeSettings()


def fitting(scan: Scan, model: registration.Model) -> Callable[[np.ndarray], BeamFit]:
    everywhere = np.ones(len(scan), dtype=np.bool_)
    settings = RobustSettings()
    noise = NoiseModel.of(0.35, settings.noise)
    fitter = BeamFitter(scan, model.surface, noise, scan.around, noise_known=False, settings=settings)
    return lambda start: fitter.fit(start, everywhere)


def part_of(scan: Any, radius_mm: float) -> np.ndarray:
    """Points about the middle of the socket alone, where it is a sphere but for its fossa."""
    aside = np.linalg.norm(scan.points[:, :2] - scan.points[:, :2].mean(axis=0), axis=1)
    return np.asarray(aside < radius_mm)


def test_a_rotation_that_is_held_well_is_left_alone(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = checked_scan(scan_of(socket, 0).points)
    fitted = fitting(scan, socket)
    best = fitted(scan_of(socket, 0).truth)
    assert along_weak_mode(best, scan, fitted, WALK) == [best]


@pytest.mark.parametrize("seed", range(3))
def test_a_weak_one_is_fitted_from_both_sides(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    seen = scan_of(socket, 60 + seed)
    scan = checked_scan(seen.points[part_of(seen, 11.0)])
    fitted = fitting(scan, socket)
    begun: list[np.ndarray] = []
    best = fitted(seen.truth)
    ends = along_weak_mode(best, scan, lambda start: begun.append(start) or fitted(start), WALK)
    assert ends[0] is best
    assert len(ends) == 3
    first, second = (start @ inverse(best.model_from_scanner) for start in begun)
    assert 0.5 < rotation_angle_deg(first[:3, :3]) < 12.0, "two standard deviations of a weak rotation"
    np.testing.assert_allclose(first[:3, :3] @ second[:3, :3], np.eye(3), atol=1e-9, err_msg="to either side")
    found = registration.register(scan.points, socket, start=seen.truth)
    likeliest = max(ends, key=lambda end: end.log_likelihood)
    assert -found.cost >= likeliest.log_likelihood - 2.0 / len(scan), "the likeliest end is what is returned"


def test_alternatives_spread_the_covariance() -> None:
    best = pose(rotation_from_vector(np.array([0.2, 0.1, -0.4])), np.array([10.0, -5.0, 900.0]))
    centre = np.array([3.0, 2.0, 1.0])
    turn, shift = np.array([0.02, 0.0, -0.01]), np.array([0.1, -0.3, 0.2])

    def end(sign: float, weight: float) -> Alternative:
        rotation = rotation_from_vector(sign * turn)
        return Alternative(pose(rotation, centre + sign * shift - rotation @ centre) @ best, weight)

    assert not dispersion(best, [], centre).any()
    motion = np.concatenate([turn, shift])
    found = dispersion(best, [end(1.0, 1.0), end(-1.0, 1.0)], centre)
    np.testing.assert_allclose(found, 2.0 / 3.0 * np.outer(motion, motion), atol=1e-12)
    np.testing.assert_allclose(dispersion(best, [end(1.0, 1e-9)], centre), 0.0, atol=1e-9)


def test_ends_are_weighted_by_their_likelihood(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = checked_scan(scan_of(socket, 0, n=20).points)
    best = fitting(scan, socket)(scan_of(socket, 0, n=20).truth)
    worse = replace(best, log_likelihood=best.log_likelihood - 5.0 / len(scan))
    impossible = replace(best, log_likelihood=-np.inf)
    weights = [end.weight for end in alternatives_of(best, [worse, best, impossible], len(scan), WALK)]
    np.testing.assert_allclose(weights, [np.exp(-1.0), 0.0])
