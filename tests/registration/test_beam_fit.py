"""The beam fit on flat bodies, where what it should do can be said in a line of arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.model import Surface
from picoradar.registration.refine import BeamFit, BeamFitter
from picoradar.registration.scan import NoiseModel, Scan, bone_probability, checked_scan, log_likelihood
from picoradar.registration.se3 import pose, rotation_from_vector
from picoradar.registration.settings import RobustSettings

SETTINGS = RobustSettings()
ABOVE = np.array([0.0, 0.0, 900.0])
"""The scanner, mm, in front of a plate at z = 0; scanner and model frame are one."""


def plate(half_mm: float = 40.0, z_mm: float = 0.0, *, faces_up: bool = True) -> tuple[np.ndarray, np.ndarray]:
    h = half_mm
    vertices = np.array([[-h, -h, z_mm], [h, -h, z_mm], [h, h, z_mm], [-h, h, z_mm]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return vertices, faces if faces_up else faces[:, ::-1]


def surface_of(*parts: tuple[np.ndarray, np.ndarray]) -> Surface:
    first = np.cumsum([0, *(len(v) for v, _ in parts)])
    vertices = np.concatenate([v for v, _ in parts])
    return Surface(vertices, np.concatenate([f + k for (_, f), k in zip(parts, first[:-1], strict=True)]))


def box(half_mm: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed cube about the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float) * half_mm
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return corners, np.array(faces)


def raster(half_mm: float, step_mm: float) -> np.ndarray:
    """Places (N, 3) on the plate."""
    ticks = np.arange(-half_mm, half_mm + step_mm / 2.0, step_mm)
    x, y = np.meshgrid(ticks, ticks)
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)


def measured(places: np.ndarray, origin: np.ndarray, short_mm: np.ndarray | float = 0.0) -> Scan:
    """A scan of places whose beams end so much in front of them."""
    beams = (places - origin) / np.linalg.norm(places - origin, axis=1, keepdims=True)
    return checked_scan(places - np.reshape(short_mm, (-1, 1)) * beams, origin=origin)


def fit_of(
    scan: Scan,
    surface: Surface,
    noise_mm: float,
    *,
    noise_known: bool = True,
    settings: RobustSettings = SETTINGS,
    start: np.ndarray | None = None,
) -> BeamFit:
    noise = NoiseModel.of(noise_mm, settings.noise)
    fitter = BeamFitter(scan, surface, noise, scan.around, noise_known=noise_known, settings=settings)
    return fitter.fit(np.eye(4) if start is None else start, np.ones(len(scan), dtype=np.bool_))


@pytest.mark.parametrize(("sigmas", "counts"), [(2.5, True), (4.5, False)])
def test_a_spike_counts_up_to_three_and_a_half_sigma(sigmas: float, counts: bool) -> None:
    """Inside bone, where no tissue explains it, among neighbours that vote for bone: the limit alone keeps it out."""
    places = raster(15.0, 1.5)
    spike = np.flatnonzero((places[:, :2] == 0.0).all(axis=1))
    off = np.zeros(len(places))
    off[spike] = -sigmas * np.hypot(0.1, SETTINGS.noise.model_mm)
    scan = measured(places, ABOVE, off)
    fit = fit_of(scan, surface_of(plate()), 0.1)
    probability = bone_probability(off, 0.1, scan.around, SETTINGS.tissue)
    assert probability[spike] > 0.5
    assert fit.inliers[spike] == counts
    assert fit.inliers.sum() == len(places) - (not counts)


def test_a_film_pulls_by_its_probability_of_being_bone() -> None:
    """Strips along two edges of a plate lie under a film: the fit rests where the weighted mean height is nil."""
    places = raster(15.0, 1.5)
    height = np.where(np.abs(places[:, 0]) > 13.0, 1.0, 0.0)
    exact = replace(SETTINGS, noise=replace(SETTINGS.noise, lateral_mm=1e-6, model_mm=1e-6))
    scan = measured(places, np.array([0.0, 0.0, 1e5]), height)
    fit = fit_of(scan, surface_of(plate()), 0.4, settings=exact)
    shift, weight = 0.0, np.ones(len(places))
    for _ in range(50):
        weight = bone_probability(height + shift, 0.4, scan.around, SETTINGS.tissue)
        weight *= weight > SETTINGS.beam_fit.min_bone_probability
        shift = -float(weight @ height / weight.sum())
    in_doubt = (weight > 0.5) & (weight < 0.9)
    assert in_doubt.sum() > 30, "or the test shows nothing"
    assert fit.model_from_scanner[2, 3] == pytest.approx(shift, abs=2e-3)


def test_the_beams_are_cast_again_until_the_points_rest(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    """Of a start 4 deg off, the tangent planes of the first cast are not yet those of the end."""
    seen = scan_of(socket, 3, noise_mm=0.0)
    turn = rotation_from_vector(np.radians(4.0) * np.array([0.6, 0.64, 0.48]))
    scan = checked_scan(seen.points)
    fit = fit_of(scan, socket.surface, 0.3, start=pose(turn, np.array([0.2, -0.1, 0.3])) @ seen.truth)
    error = registration.pose_error(fit.model_from_scanner, seen.truth, np.zeros(3))
    assert error.rotation_deg < 0.01
    assert error.translation_mm < 0.003


def test_the_range_noise_is_that_of_beams_seen_from_in_front() -> None:
    """On a wall seen at 20 deg of elevation the noise across the beam shows along it, nearly three times as large."""
    rng = np.random.default_rng(8)
    origin = np.array([880.0, 0.0, 330.0])
    t = np.arange(-18.0, 18.5, 1.5)
    a, b = (grid.ravel() for grid in np.meshgrid(t, t))
    places = np.concatenate([np.stack([np.full(a.size, 20.0), a, b], 1), np.stack([a, b, np.full(a.size, 20.0)], 1)])
    noise = rng.normal(0.0, 0.3, places.shape)  # as large across the beam as along it
    scan = checked_scan(places + noise, origin=origin)
    settings = replace(SETTINGS, noise=replace(SETTINGS.noise, lateral_mm=0.3))
    fit = fit_of(scan, surface_of(box()), 0.4, noise_known=False, settings=settings)
    assert fit.inliers[a.size :].mean() > 0.8, "the wall seen flat takes part in the fit"
    assert fit.noise.range_mm == pytest.approx(0.3 * np.hypot(1.0, 0.35), rel=0.1)


@pytest.mark.parametrize(("cosine", "counts"), [(0.03, False), (0.1, True)])
def test_a_wall_seen_edge_on_takes_no_part(cosine: float, counts: bool) -> None:
    """A beam along a wall could have ended anywhere on it."""
    t = np.arange(-15.0, 15.5, 1.5)
    a, b = (grid.ravel() for grid in np.meshgrid(t, t))
    top, wall = np.stack([a, b, np.full(a.size, 20.0)], 1), np.stack([np.full(a.size, 20.0), a, b], 1)
    scan = measured(np.concatenate([top, wall]), np.array([20.0 + 900.0 * cosine, 0.0, 900.0]))
    fit = fit_of(scan, surface_of(box()), 0.1)
    assert fit.inliers[: a.size].all()
    assert fit.inliers[a.size :].mean() == pytest.approx(float(counts), abs=0.02)


def test_a_beam_passes_through_the_back_of_an_open_model() -> None:
    """Where an open model turns its back on the scanner there is no surface: what lies behind it was measured."""
    places = raster(15.0, 1.5)
    surface = surface_of(plate(), plate(4.0, z_mm=6.0, faces_up=False))
    scan = measured(places, ABOVE)
    fit = fit_of(scan, surface, 0.1)
    through = (np.abs(places[:, :2]) < 3.9).all(axis=1)
    assert (fit.met.faces[through] == -1).all()
    assert (fit.met.faces[~through & (np.abs(places[:, :2]) > 4.1).any(axis=1)] >= 0).all()
    closest = fit.closest(scan, surface)
    np.testing.assert_allclose(closest.signed_mm, 0.0, atol=1e-6)
    assert fit.log_likelihood == pytest.approx(expected_likelihood(scan, through), abs=2e-3)


def expected_likelihood(scan: Scan, lacking: np.ndarray) -> float:
    """Mean log likelihood of points without noise on bone, but for those on what an open model lacks, as of tissue."""
    sigma = np.hypot(0.1, SETTINGS.noise.model_mm)
    along = np.where(lacking, SETTINGS.tissue.residual_outside_mm, 0.0)
    return float(log_likelihood(along, sigma, scan.around, SETTINGS.tissue).mean())


def test_beams_past_the_border_of_an_open_model_are_as_likely_as_tissue() -> None:
    """Past a closed model they cannot be: it is known that nothing is there."""
    places = raster(15.0, 1.5)
    past = (np.abs(places[:, :2]) > 10.0).any(axis=1)
    open_plate = surface_of(plate(10.1))
    corners, faces = box(10.1)
    slab = surface_of((corners - [0.0, 0.0, 10.1], faces))
    scan = measured(places, ABOVE)
    likelihood = {name: fit_of(scan, s, 0.1).log_likelihood for name, s in (("open", open_plate), ("closed", slab))}
    tissue = SETTINGS.tissue
    each = np.log((tissue.density_per_mm + tissue.stray_per_mm) / tissue.stray_per_mm)
    assert likelihood["open"] - likelihood["closed"] == pytest.approx(past.mean() * each, rel=0.1)
    assert likelihood["open"] == pytest.approx(expected_likelihood(scan, past), abs=2e-3)
