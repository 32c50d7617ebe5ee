"""Stability, covariance and predicted errors against analytic cases and the computed check values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.least_squares import information, plane_rows
from picoradar.registration.robust import register_robust
from picoradar.registration.scan import checked_scan
from picoradar.registration.se3 import displacement_covariance
from picoradar.registration.settings import RobustSettings
from picoradar.registration.solution import Rival
from picoradar.registration.trust import RegistrationRequest
from picoradar.registration.trust.assess import assess
from picoradar.registration.trust.covariance import (
    chi_square_quantile,
    inverse_information,
    patch_misfit_mm,
    quantile_mm,
    stiffness,
)
from picoradar.registration.trust.words import describe_weakness


def sphere_patch(count: int, cap: float = np.pi) -> tuple[np.ndarray, np.ndarray]:
    k = np.arange(count) + 0.5
    z = 1.0 - (1.0 - np.cos(cap)) * k / count
    azimuth = k * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    normals = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)
    return 26.0 * normals, normals


def plane_patch() -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.linspace(-20, 20, 21), np.linspace(-20, 20, 21))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return points, np.broadcast_to([0.0, 0.0, 1.0], points.shape)


def turned_surface(radius: Callable[[np.ndarray], np.ndarray], slope: float) -> tuple[np.ndarray, np.ndarray]:
    h, a = np.meshgrid(np.linspace(-20, 20, 21), np.linspace(0, 2 * np.pi, 40, endpoint=False))
    h, a = h.ravel(), a.ravel()
    normals = np.stack([np.cos(a), np.sin(a), np.full_like(a, -slope)], axis=1) / np.hypot(1.0, slope)
    return np.stack([radius(h) * np.cos(a), radius(h) * np.sin(a), h], axis=1), normals


def helix_surface() -> tuple[np.ndarray, np.ndarray]:
    """A screw-shaped ramp: turning and rising together leave it where it is."""
    r, a = (v.ravel() for v in np.meshgrid(np.linspace(8, 20, 12), np.linspace(0, 4 * np.pi, 80)))
    pitch = 3.0
    points = np.stack([r * np.cos(a), r * np.sin(a), pitch * a], axis=1)
    normals = np.stack([pitch * np.sin(a), -pitch * np.cos(a), r], axis=1)
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("surface", "free"),
    [
        (sphere_patch(800), 3),
        (plane_patch(), 3),
        (turned_surface(lambda h: np.full_like(h, 15.0), 0.0), 2),
        (turned_surface(lambda h: 30.0 + 0.5 * h, 0.5), 1),
        (helix_surface(), 1),
    ],
    ids=["sphere", "plane", "cylinder", "cone", "helix"],
)
def test_free_motions_are_counted(surface: tuple[np.ndarray, np.ndarray], free: int) -> None:
    points, normals = surface
    centre = points.mean(axis=0)
    radius = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))
    found = stiffness(plane_rows(points, normals, centre), np.ones(len(points)), radius)
    assert int((found.eigenvalues < 1e-9 * found.eigenvalues[-1]).sum()) == free
    motion = found.motions[:, 0] * np.array([1 / radius] * 3 + [1.0] * 3)
    assert "(95 %), the limit is" in describe_weakness(motion, centre, radius, registration.Tolerance())


def test_hemispherical_cup() -> None:
    points, normals = sphere_patch(1000, np.pi / 2)
    found = stiffness(plane_rows(points, normals, np.zeros(3)), np.ones(1000), 26.0)
    np.testing.assert_allclose(found.eigenvalues[:3], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.eigenvalues[3:], 1.0 / 3.0, atol=0.02)


@pytest.mark.parametrize(
    ("region", "predicted"),
    [(lambda u: u[:, 2] > -2.0, 0.273), (lambda u: u[:, 2] > 0.0, 0.532)],
    ids=["whole", "upper half"],
)
def test_predicted_tre_of_the_ellipsoid(region: Callable[[np.ndarray], np.ndarray], predicted: float) -> None:
    """Check values: half axes 40, 28, 20 mm, 300 points, 0.3 mm, target 60 mm along z."""
    rng = np.random.default_rng(3)
    values = []
    for _ in range(20):
        unit = rng.normal(size=(3000, 3))
        unit /= np.linalg.norm(unit, axis=1, keepdims=True)
        unit = unit[region(unit)][:300]
        axes = np.array([40.0, 28.0, 20.0])
        points, normals = unit * axes, unit / axes
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        centre = points.mean(axis=0)
        found = information(plane_rows(points, normals, centre), np.full(300, 0.3))
        covariance = inverse_information(found, np.array([1 / 30.0] * 3 + [1.0] * 3), 1e3)
        values.append(np.sqrt(np.trace(displacement_covariance(covariance, np.array([0.0, 0.0, 60.0]) - centre))))
    assert np.mean(values) == pytest.approx(predicted, rel=0.15)


@pytest.mark.parametrize("spread", [(1.0, 1.0, 1.0), (1.0, 0.1, 0.01), (1.0, 1.0, 0.0)])
def test_quantiles_of_the_error(spread: tuple[float, float, float]) -> None:
    draws = np.random.default_rng(0).normal(size=(200_000, 3)) * np.sqrt(spread)
    expected = np.quantile(np.linalg.norm(draws, axis=1), 0.95)
    assert quantile_mm(np.diag(spread)) == pytest.approx(expected, rel=0.03)


def test_patches_are_told_from_noise() -> None:
    rows, columns = np.divmod(np.arange(900), 30)
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    inside = np.stack(
        [(rows + i >= 0) & (rows + i < 30) & (columns + j >= 0) & (columns + j < 30) for i, j in steps], 1
    )
    around = np.where(inside, np.stack([(rows + i) * 30 + columns + j for i, j in steps], axis=1), 900)
    noise = np.random.default_rng(0).normal(0.0, 0.4, 900)
    wave = 0.5 * np.sqrt(2.0) * np.sin(rows / 4.0)
    everything = np.ones(900, dtype=bool)
    assert patch_misfit_mm(noise, everything, around, 3) < 0.1
    assert patch_misfit_mm(noise + wave, everything, around, 3) == pytest.approx(0.5, rel=0.15)


@pytest.mark.parametrize("probability", [0.5, 0.9, 0.95, 0.999])
def test_the_chi_square_quantile_is_that_of_scipy(probability: float) -> None:
    from scipy.special import chdtri

    for degrees in (0.3, 1.0, 1.7, 2.0, 3.0, 10.0, 200.0):
        expected = float(chdtri(degrees, 1.0 - probability))
        assert chi_square_quantile(degrees, probability) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("nats", "verdict"), [(19.0, "caution"), (21.0, "pass")])
def test_a_rival_of_a_dense_scan_is_weighed_by_fewer_points(
    socket: registration.Model, scan_of: Callable[..., Any], nats: float, verdict: str
) -> None:
    """Ten thousand points see the same clumps of tissue as fifteen hundred: 20 nats of these are over 100 of those."""
    scan = checked_scan(scan_of(socket, 0, n=100).points)
    solved = register_robust(scan, socket, None, None, np.zeros((0, 4)), RobustSettings())
    rival = Rival(solved.model_from_scanner, solved.cost + nats / 1500.0, 9.0, 0.1)
    request = RegistrationRequest(
        targets=None, tolerance=registration.Tolerance(), budget=registration.ErrorBudget(range_bias_mm=0.1)
    )
    assert len(scan) > 5000
    assert assess(scan, replace(solved, rivals=[rival]), request, [], RobustSettings()).verdict == verdict
