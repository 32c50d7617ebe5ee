"""Weakly held rotations: the beam fit begins again from both sides, and what it finds there counts as uncertainty."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.model import Closest
from picoradar.registration.refine import BeamFit, BeamFitter, along_weak_mode, alternatives_of, dispersion
from picoradar.registration.scan import NoiseModel, Scan, checked_scan
from picoradar.registration.se3 import inverse, pose, rotation_angle_deg, rotation_from_vector, small_motion, transform
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


def test_an_alternative_may_be_half_a_turn_away() -> None:
    """As that of a body which looks the same from behind."""
    best = pose(rotation_from_vector(np.array([0.2, 0.1, -0.4])), np.array([10.0, -5.0, 900.0]))
    half_turn = pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    found = dispersion(best, [Alternative(half_turn @ best, 1.0)], np.zeros(3))
    np.testing.assert_allclose(found, np.diag([0.0, 0.0, np.pi**2 / 2.0, 0.0, 0.0, 0.0]), atol=1e-9)


def test_ends_are_weighted_by_their_likelihood(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = checked_scan(scan_of(socket, 0, n=20).points)
    best = fitting(scan, socket)(scan_of(socket, 0, n=20).truth)
    worse = replace(best, log_likelihood=best.log_likelihood - 5.0 / len(scan))
    impossible = replace(best, log_likelihood=-np.inf)
    weights = [end.weight for end in alternatives_of(best, [worse, best, impossible], len(scan), WALK)]
    np.testing.assert_allclose(weights, [np.exp(-1.0), 0.0])


LEVERS_MM = np.array([4.0, 10.0, 6.0])
SIGMA_MM = 0.3
TIMES = 4
"""How often each of the six points of :func:`on_levers` is measured."""

SD_RAD = SIGMA_MM / np.sqrt(2 * TIMES) / LEVERS_MM
"""Standard deviations about x, y and z: 2 x 4 residuals measure each rotation, by a lever."""


def on_levers(best: np.ndarray) -> tuple[Scan, BeamFit]:
    """A fit of points on both ends of three axes, whose normals measure one rotation and one shift each; 3 outliers."""
    axes = np.eye(3)
    ends = [(sign * LEVERS_MM[k] * axes[k - 1], axes[k - 2]) for k in range(3) for sign in (-1.0, 1.0)]
    centre = np.array([5.0, -3.0, 2.0])
    places = np.concatenate([np.tile([place for place, _ in ends], (TIMES, 1)), np.full((3, 3), 50.0)]) + centre
    normals = np.concatenate([np.tile([normal for _, normal in ends], (TIMES, 1)), np.tile(axes[0], (3, 1))])
    scan = checked_scan(transform(inverse(best), places))
    inliers = np.arange(len(scan)) < len(scan) - 3
    met = Closest(places, normals, np.zeros(len(scan)), np.zeros(len(scan), dtype=np.int64))
    return scan, BeamFit(best, met, inliers, NoiseModel(SIGMA_MM, SIGMA_MM, 0.0), [], 0.0)


def begun_from(settings: WeakModeSettings) -> list[np.ndarray]:
    """Motions (4, 4), about the levers' middle, from the fit to where it is begun again."""
    best = pose(rotation_from_vector(np.array([0.3, -0.2, 0.5])), np.array([1.0, 2.0, 900.0]))
    scan, fit = on_levers(best)
    starts: list[np.ndarray] = []
    ends = along_weak_mode(fit, scan, lambda start: starts.append(start) or fit, settings)
    assert ends == [fit] * (1 + len(starts))
    return [start @ inverse(best) for start in starts]


@pytest.mark.parametrize(("max_sd_rad", "sd_rad"), [(1.0, SD_RAD[0]), (0.02, 0.02)])
def test_the_weakest_rotation_is_walked_by_its_standard_deviations(max_sd_rad: float, sd_rad: float) -> None:
    """About x, which is held by the shortest lever; no standard deviation counts for more than its limit."""
    begun = begun_from(WeakModeSettings(walk_sd=1.5, max_sd_rad=max_sd_rad))
    about_x = [np.array([sign * 1.5 * sd_rad, 0.0, 0.0, 0.0, 0.0, 0.0]) for sign in (-1.0, 1.0)]
    expected = [small_motion(x, np.array([5.0, -3.0, 2.0])) for x in about_x]
    if begun[0][1, 2] < 0.0:  # an eigenvector may point either way
        begun = begun[::-1]
    np.testing.assert_allclose(begun, expected, atol=1e-9)


def test_it_is_walked_from_a_total_spread_on() -> None:
    """The root of the three variances' sum."""
    spread_deg = float(np.degrees(np.sqrt(np.sum(SD_RAD**2))))
    assert len(begun_from(WeakModeSettings(min_rotation_sd_deg=spread_deg - 1e-3))) == 2
    assert not begun_from(WeakModeSettings(min_rotation_sd_deg=spread_deg + 1e-3))


def test_of_few_points_no_motion_is_told() -> None:
    assert len(begun_from(WeakModeSettings(min_points=6 * TIMES))) == 2
    assert not begun_from(WeakModeSettings(min_points=6 * TIMES + 1))
