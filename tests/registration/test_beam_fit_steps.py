"""The beam fit step by step: how far one goes, when casts end, where too few points are left, and how edges hold it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from picoradar.registration.model import Closest, Surface
from picoradar.registration.refine import BeamFit, BeamFitter
from picoradar.registration.refine.beam_fit import ridge
from picoradar.registration.scan import MIN_POINTS, NoiseModel, Scan, bone_probability, checked_scan, log_likelihood
from picoradar.registration.se3 import small_motion
from picoradar.registration.settings import BeamFitSettings, RobustSettings

FAR = np.array([0.0, 0.0, 1e5])
"""The scanner, mm: its beams are as good as parallel to -z; scanner and model frame are one."""

NOISE_MM = 0.3
EXACT = replace(RobustSettings(), noise=replace(RobustSettings().noise, lateral_mm=1e-9, model_mm=1e-9))
"""Nothing but the noise along the beam."""

HERE = np.eye(4)


def one_plate(half_mm: float = 40.0) -> Surface:
    h = half_mm
    return Surface(np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]], float), np.array([[0, 1, 2], [0, 2, 3]]))


def cube(half_mm: float) -> Surface:
    """Closed, about the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float) * half_mm
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return Surface(corners, np.array(faces))


def scan_at(z_mm: float, half_mm: float = 15.0, step_mm: float = 1.5) -> Scan:
    """A raster of points at one height, seen from far above."""
    ticks = np.arange(-half_mm, half_mm + step_mm / 2.0, step_mm)
    x, y = np.meshgrid(ticks, ticks)
    return checked_scan(np.stack([x.ravel(), y.ravel(), np.full(x.size, z_mm)], axis=1), origin=FAR)


def fitter_of(scan: Scan, surface: Surface | None = None, **steps: float) -> BeamFitter:
    """With the noise known; `steps` are settings of the beam fit."""
    settings = replace(EXACT, beam_fit=replace(EXACT.beam_fit, **steps))
    noise = NoiseModel.of(NOISE_MM, settings.noise)
    return BeamFitter(scan, surface or one_plate(), noise, scan.around, noise_known=True, settings=settings)


def all_of(scan: Scan) -> np.ndarray:
    return np.ones(len(scan), dtype=np.bool_)


def heights(poses: list[np.ndarray]) -> np.ndarray:
    return np.array([pose[2, 3] for pose in poses])


def test_the_ridge_is_one_over_the_a_priori_variances() -> None:
    found = ridge(BeamFitSettings(prior_rad=0.5, prior_mm=4.0))
    np.testing.assert_allclose(found, [4.0, 4.0, 4.0, 0.0625, 0.0625, 0.0625])


def test_one_step_is_that_of_weighted_least_squares() -> None:
    """Points under the plate by 0.5 mm: the weights are probability over variance, against one prior of a shift."""
    scan = scan_at(-0.5)
    fit = fitter_of(scan, max_casts=1, max_reweighted_steps=1, prior_mm=0.02).fit(HERE, all_of(scan))
    bone = bone_probability(np.full(len(scan), -0.5), NOISE_MM, scan.around, EXACT.tissue)
    weight = float(bone.sum()) / NOISE_MM**2
    share = weight / (weight + 1.0 / 0.02**2)
    assert 0.3 < share < 0.8, "or the prior shows nothing"
    assert fit.model_from_scanner[2, 3] == pytest.approx(0.5 * share, rel=1e-5)
    np.testing.assert_allclose(fit.met.signed_mm, -0.5 * (1.0 - share), rtol=1e-4, err_msg="of the end, not the start")


def test_a_cast_ends_when_its_weights_have_settled_and_the_last_when_the_points_rest() -> None:
    """On one plane the second step of the first cast changes nothing, nor does the first of the second cast."""
    scan = scan_at(-0.5)
    fit = fitter_of(scan).fit(HERE, all_of(scan))
    assert [one.rms_mm for one in fit.history] == pytest.approx([0.5, 0.0, 0.0], abs=1e-3)
    assert fit.model_from_scanner[2, 3] == pytest.approx(0.5, abs=1e-3)


def test_the_history_measures_the_inliers() -> None:
    """Half of the points 0.2 mm under the plate, half 0.4 mm, and one that no bone explains."""
    points = scan_at(-0.2).points.copy()
    points[::2, 2] = -0.4
    points[0, 2] = -5.0
    scan = checked_scan(points, origin=FAR)
    first = fitter_of(scan).fit(HERE, all_of(scan)).history[0]
    size = np.where(np.arange(1, len(points)) % 2, 0.2, 0.4)
    assert first.points == len(points) - 1
    assert (first.rms_mm, first.mean_mm, first.max_mm) == pytest.approx(
        (float(np.sqrt(np.mean(size**2))), float(size.mean()), 0.4), rel=1e-4
    )


@pytest.mark.parametrize("casts", [1, 3])
def test_beams_are_cast_so_often_at_most(casts: int) -> None:
    """With limits of nil no step is small enough: all casts and all steps of each are made."""
    scan = scan_at(-0.5)
    settings = {"max_casts": casts, "max_reweighted_steps": 4, "settled_mm": 0.0, "resting_mm": 0.0}
    fit = fitter_of(scan, **settings).fit(HERE, all_of(scan))
    assert len(fit.history) == 4 * casts
    np.testing.assert_allclose(fit.met.signed_mm, 0.0, atol=1e-3)


@pytest.mark.parametrize("left", [MIN_POINTS, MIN_POINTS - 1])
def test_a_pose_has_six_unknowns(left: int) -> None:
    """With six points there is a fit, with five the pose stays where it was, and nothing is less likely."""
    scan = scan_at(-0.5)
    allowed = np.zeros(len(scan), dtype=np.bool_)
    allowed[[0, 20, 220, 418, 440, 300][:left]] = True
    start = small_motion(np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0]), np.zeros(3))
    fit = fitter_of(scan).fit(start, allowed)
    assert fit.inliers.sum() == left
    if left == MIN_POINTS:
        assert np.isfinite(fit.log_likelihood)
        assert fit.model_from_scanner[2, 3] == pytest.approx(0.5, abs=0.01)
    else:
        assert fit.log_likelihood == -np.inf
        np.testing.assert_array_equal(fit.model_from_scanner, start)
        np.testing.assert_allclose(fit.met.signed_mm, -0.5, atol=1e-6)
        assert fit.history == []


@pytest.mark.parametrize("z_mm", [0.0, -0.4])
def test_the_likelihood_of_a_pose_as_it_is(z_mm: float) -> None:
    """Half of the points take no part: they count as ones that cannot have been measured from there."""
    scan = scan_at(z_mm)
    allowed = scan.points[:, 0] < 0.0
    fitter = fitter_of(scan)
    along = np.where(allowed, z_mm, -EXACT.tissue.residual_inside_mm)
    expected = log_likelihood(along, NOISE_MM, scan.around, EXACT.tissue).mean()
    assert fitter.likelihood_at(HERE, fitter.noise, allowed) == pytest.approx(expected, rel=1e-5)
    if z_mm:
        up = small_motion(np.array([0.0, 0.0, 0.0, 0.0, 0.0, -z_mm]), np.zeros(3))
        assert fitter.likelihood_at(up, fitter.noise, allowed) > expected + 0.1


@dataclass(frozen=True)
class Doubting(BeamFitter):
    """Finds the first poses that are asked for worse than any, and all others as likely as one of them."""

    as_likely_as: np.ndarray = field(default_factory=lambda: HERE)
    refusals: int = 0
    asked: list[np.ndarray] = field(default_factory=list)

    def likelihood_at(self, pose: np.ndarray, noise: NoiseModel, allowed: np.ndarray) -> float:
        self.asked.append(pose)
        return -np.inf if len(self.asked) <= self.refusals else super().likelihood_at(self.as_likely_as, noise, allowed)


def doubting(scan: Scan, refusals: int, **steps: float) -> Doubting:
    """Steps count as no better than where they begin, as soon as they are not refused."""
    mine = fitter_of(scan, **steps)
    parts = (mine.scan, mine.surface, mine.noise, mine.around, mine.noise_known, mine.settings)
    return Doubting(*parts, edges=True, refusals=refusals)


@pytest.mark.parametrize("refusals", [0, 1, 3])
def test_among_edges_a_step_is_halved_until_its_end_is_no_less_likely(refusals: int) -> None:
    scan = scan_at(-0.5)
    fitter = doubting(scan, refusals, max_casts=1)
    fit = fitter.fit(HERE, all_of(scan))
    np.testing.assert_allclose(heights(fitter.asked), 0.5 * 0.5 ** np.arange(refusals + 1), atol=1e-3)
    assert fit.model_from_scanner[2, 3] == pytest.approx(0.5 * 0.5**refusals, abs=1e-3)
    np.testing.assert_allclose(fit.met.signed_mm, -0.5 * (1.0 - 0.5**refusals), atol=2e-3)


def test_among_edges_no_step_is_made_that_stays_less_likely() -> None:
    """Nor another cast, for the points rest; with a limit of nil they never do."""
    scan = scan_at(-0.5)
    fitter = doubting(scan, 1000)
    fit = fitter.fit(HERE, all_of(scan))
    np.testing.assert_array_equal(fit.model_from_scanner, HERE)
    assert len(fitter.asked) == EXACT.edges.max_halvings
    restless = doubting(scan, 1000, resting_mm=0.0, max_casts=3)
    restless.fit(HERE, all_of(scan))
    assert len(restless.asked) == 3 * EXACT.edges.max_halvings


def test_without_edges_no_step_is_put_to_the_test() -> None:
    scan = scan_at(-0.5)
    fitter = replace(doubting(scan, 1000), edges=BeamFitter.edges)
    assert fitter.fit(HERE, all_of(scan)).model_from_scanner[2, 3] == pytest.approx(0.5, abs=1e-3)
    assert not fitter.asked


INSIDE, OUTSIDE, ON, UP = [1.0, 2.0, 18.0], [3.0, 1.0, 20.5], [2.0, 3.0, 20.0], [0.0, 0.0, 1.0]
OTHERS = [[9.0, 0.0, 20.0], [0.0, 9.0, 20.0], [-9.0, 0.0, 20.0], [0.0, -9.0, 20.0], [8.0, 8.0, 20.0], [-8.0, 8.0, 20.0]]


@pytest.mark.parametrize(("end", "distance_mm", "normal_z"), [(INSIDE, 2.0, -1.0), (OUTSIDE, 0.5, 1.0), (ON, 0.0, 1.0)])
def test_a_beam_that_misses_ended_outside(end: list[float], distance_mm: float, normal_z: float) -> None:
    """The closest point stands in for what it did not meet, with the normal towards the beam's end."""
    shift = np.array([0.0, 0.0, 7.0])
    scan = checked_scan(np.array([*OTHERS, end]) - shift, origin=FAR)
    count = len(scan)
    met = Closest(
        np.full((count, 3), 5.0), np.tile(UP, (count, 1)), np.full(count, 0.25), np.array([0] * len(OTHERS) + [-1])
    )
    pose = small_motion(np.concatenate([np.zeros(3), shift]), np.zeros(3))
    fit = BeamFit(pose, met, all_of(scan), NoiseModel.of(NOISE_MM, EXACT.noise), [], 0.0)
    surface = cube(20.0)
    found = fit.closest(scan, surface)
    np.testing.assert_allclose(found.points[-1], [*end[:2], 20.0], atol=1e-9)
    np.testing.assert_allclose(found.normals[-1], [0.0, 0.0, normal_z], atol=1e-9)
    assert found.signed_mm[-1] == pytest.approx(distance_mm, abs=1e-9)
    np.testing.assert_allclose(surface.face_normals[found.faces[-1]], UP, atol=1e-9)
    np.testing.assert_array_equal(found.signed_mm[:-1], 0.25)
    np.testing.assert_array_equal(found.points[:-1], 5.0)
    np.testing.assert_array_equal(found.faces[:-1], 0)
    assert met.faces[-1] == -1, "what was met stays as it was"


def test_beams_that_all_meet_the_model_are_taken_as_they_are() -> None:
    scan = scan_at(0.0)
    fit = fitter_of(scan).fit(HERE, all_of(scan))
    assert fit.closest(scan, one_plate()) is fit.met
