"""Weakly held rotations: the beam fit begins again from both sides, and what it finds there counts as uncertainty."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.model import Closest
from picoradar.registration.refine import BeamFit, BeamFitter, alternatives_of, beside_weak, dispersion
from picoradar.registration.scan import NoiseModel, Scan, checked_scan
from picoradar.registration.se3 import (
    inverse,
    pose,
    rotation_angle_deg,
    rotation_from_vector,
    small_motion,
    transform,
    vector_from_rotation,
)
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
    assert beside_weak(best, scan, fitted, WALK) == [best]


@pytest.mark.parametrize("seed", range(3))
def test_a_weak_one_is_fitted_from_all_sides(
    socket: registration.Model, scan_of: Callable[..., Any], seed: int
) -> None:
    seen = scan_of(socket, 60 + seed)
    scan = checked_scan(seen.points[part_of(seen, 11.0)])
    fitted = fitting(scan, socket)
    begun: list[np.ndarray] = []
    best = fitted(seen.truth)
    ends = beside_weak(best, scan, lambda start: begun.append(start) or fitted(start), WALK)
    assert ends[0] is best
    assert len(ends) == 13
    turns = [rotation_angle_deg((start @ inverse(best.model_from_scanner))[:3, :3]) for start in begun]
    np.testing.assert_allclose(sorted(turns), [2.0] * 6 + [4.0] * 6, atol=1e-6)
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


def turned(best: np.ndarray, centre: np.ndarray, deg: float) -> np.ndarray:
    return small_motion(np.radians([0.0, 0.0, deg, 0.0, 0.0, 0.0]), centre) @ best


def test_other_minima_count_once_and_by_their_likelihood() -> None:
    """Those within three standard deviations of the pose, or of a likelier end, are the same minimum."""
    best = pose(rotation_from_vector(np.array([0.3, -0.2, 0.5])), np.array([1.0, 2.0, 900.0]))
    scan, fit = on_levers(best)
    centre, sd_deg = np.array([5.0, -3.0, 2.0]), float(np.degrees(SD_RAD[2]))
    fold = WALK.e_fold_nats / len(scan)
    ends = [
        (turned(best, centre, 2.9 * sd_deg), -1.0 * fold),
        (turned(best, centre, 20.0 * sd_deg), -2.0 * fold),
        (turned(best, centre, 10.0 * sd_deg), -1.0 * fold),
        (turned(best, centre, 12.9 * sd_deg), -3.0 * fold),
        (turned(best, centre, -10.0 * sd_deg), -20.0 * fold),
        (turned(best, centre, -20.0 * sd_deg), -np.inf),
    ]
    fits = [replace(fit, model_from_scanner=end, log_likelihood=likelihood) for end, likelihood in ends]
    found = alternatives_of(fit, [fit, *fits], scan, len(scan), WALK)
    np.testing.assert_allclose([end.weight for end in found], np.exp([-1.0, -2.0]))
    assert found[0].model_from_scanner is ends[2][0]


def test_doubt_about_tissue_takes_information_away() -> None:
    """Half of it for each point: twice the variance, and three standard deviations reach farther."""
    best = pose(rotation_from_vector(np.array([0.3, -0.2, 0.5])), np.array([1.0, 2.0, 900.0]))
    scan, sure = on_levers(best)
    doubtful = replace(sure, observed=0.5 * sure.inliers / SIGMA_MM**2)
    centre, sd_deg = np.array([5.0, -3.0, 2.0]), float(np.degrees(SD_RAD[2]))
    end = replace(sure, model_from_scanner=turned(best, centre, 4.0 * sd_deg))
    assert len(alternatives_of(sure, [end], scan, len(scan), WALK)) == 1
    assert not alternatives_of(doubtful, [end], scan, len(scan), WALK)


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
    ends = beside_weak(fit, scan, lambda start: starts.append(start) or fit, settings)
    assert ends == [fit] * (1 + len(starts))
    return [start @ inverse(best) for start in starts]


def test_the_worst_held_axes_are_turned_about() -> None:
    """About x, which is held by the shortest lever, and then about z."""
    begun = begun_from(WeakModeSettings(walk_deg=(3.0,), walked_axes=2))
    turns = np.degrees([vector_from_rotation(motion[:3, :3]) for motion in begun])
    expected = np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
    for k in range(2):
        np.testing.assert_allclose(np.abs(turns[2 * k : 2 * k + 2]), expected[[k, k]], atol=1e-9)
        np.testing.assert_allclose(turns[2 * k], -turns[2 * k + 1], atol=1e-9, err_msg="to either side")
    for motion in begun:
        np.testing.assert_allclose(transform(motion, np.array([[5.0, -3.0, 2.0]]))[0], [5.0, -3.0, 2.0], atol=1e-9)


def test_it_is_walked_from_a_total_spread_on() -> None:
    """The root of the three variances' sum."""
    spread_deg = float(np.degrees(np.sqrt(np.sum(SD_RAD**2))))
    assert len(begun_from(WeakModeSettings(min_rotation_sd_deg=spread_deg - 1e-3))) == 12
    assert not begun_from(WeakModeSettings(min_rotation_sd_deg=spread_deg + 1e-3))


def test_of_few_points_no_motion_is_told() -> None:
    assert len(begun_from(WeakModeSettings(min_points=6 * TIMES))) == 12
    assert not begun_from(WeakModeSettings(min_points=6 * TIMES + 1))
