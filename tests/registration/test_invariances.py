"""What must not change a registration: order, frame, unit, a far origin, the number of threads, a fresh cache."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar import registration
from picoradar.registration import paired_points
from picoradar.registration.classic.icp import icp
from picoradar.registration.model import Surface
from picoradar.registration.se3 import inverse, pose, rotation_from_vector, transform

START = pose(rotation_from_vector(np.radians([2.0, -1.0, 2.0])), np.array([1.0, -1.0, 1.0]))
OPTIONS: dict[str, Any] = {"max_iterations": 25, "tolerance_mm2": 1e-12}


@pytest.fixture(scope="module")
def wedge() -> Surface:
    """Two faces of different slope with a step between them: every motion is held."""
    x, y = np.meshgrid(np.linspace(-20, 20, 21), np.linspace(-15, 15, 16), indexing="ij")
    z = 0.4 * np.abs(x) + 0.02 * y**2 + 3.0 * (np.abs(y) < 4.0)
    a = (np.arange(20)[:, None] * 16 + np.arange(15)).ravel()
    faces = np.concatenate([np.stack([a, a + 16, a + 17], 1), np.stack([a, a + 17, a + 1], 1)])
    return Surface(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), faces)


@pytest.fixture(scope="module")
def noisy(wedge: Surface) -> np.ndarray:
    rng = np.random.default_rng(3)
    return wedge.vertices[rng.permutation(len(wedge.vertices))[:120]] + rng.normal(0.0, 0.2, (120, 3))


def random_pose(seed: int, offset_mm: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return pose(rotation_from_vector(rng.normal(size=3) * 2.0), rng.normal(size=3) * offset_mm)


def test_icp_falls_in_every_iteration_and_never_mirrors(wedge: Surface, noisy: np.ndarray) -> None:
    found = icp(noisy, wedge, START, **OPTIONS)
    assert len(found.history) > 5
    assert (np.diff([entry.rms_mm for entry in found.history]) <= 0.0).all()
    assert np.linalg.det(found.model_from_scanner[:3, :3]) == pytest.approx(1.0, abs=1e-12)


def test_the_truth_is_a_fixed_point_of_icp(wedge: Surface) -> None:
    truth = random_pose(5, 100.0)
    found = icp(transform(inverse(truth), wedge.vertices), wedge, truth, **OPTIONS)
    assert found.converged
    np.testing.assert_allclose(found.model_from_scanner, truth, atol=1e-9)
    assert found.distances_mm.max() < 1e-9


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 10_000), far=st.booleans())
def test_icp_does_not_depend_on_order_or_frames(wedge: Surface, noisy: np.ndarray, seed: int, far: bool) -> None:
    """Also with 10 m between the bodies and their origins."""
    base = icp(noisy, wedge, START, **OPTIONS).model_from_scanner
    a, b = random_pose(seed, 1e4 if far else 50.0), random_pose(seed + 1, 1e4 if far else 50.0)
    order = np.random.default_rng(seed).permutation(len(noisy))
    moved = Surface(transform(a, wedge.vertices), wedge.faces)
    found = icp(transform(b, noisy)[order], moved, a @ START @ inverse(b), **OPTIONS).model_from_scanner
    back = transform(inverse(a) @ found @ b, noisy)
    np.testing.assert_allclose(back, transform(base, noisy), atol=1e-6 if far else 1e-8)


def test_icp_does_not_depend_on_the_unit(wedge: Surface, noisy: np.ndarray) -> None:
    base = icp(noisy, wedge, START, **OPTIONS).model_from_scanner
    start = START.copy()
    start[:3, 3] /= 1000.0
    in_metres = icp(
        noisy / 1000.0, Surface(wedge.vertices / 1000.0, wedge.faces), start, max_iterations=25, tolerance_mm2=1e-18
    ).model_from_scanner
    np.testing.assert_allclose(in_metres[:3, :3], base[:3, :3], atol=1e-10)
    np.testing.assert_allclose(1000.0 * in_metres[:3, 3], base[:3, 3], atol=1e-8)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), scale=st.sampled_from([1e-3, 1.0, 1e3]), weighted=st.booleans())
def test_paired_points_do_not_depend_on_order_unit_or_a_far_origin(seed: int, scale: float, weighted: bool) -> None:
    rng = np.random.default_rng(seed)
    moving = rng.normal(size=(10, 3)) * 40.0
    fixed = transform(random_pose(seed, 50.0), moving) + rng.normal(size=(10, 3))
    root = rng.normal(size=(10, 3, 3))
    sigma = root @ root.swapaxes(1, 2) + np.eye(3) if weighted else None
    base = paired_points(fixed, moving, fixed_covariance=sigma)
    order, far = rng.permutation(10), np.array([1e4, -1e4, 1e4])
    again = paired_points(
        scale * (fixed + far)[order],
        scale * (moving - far)[order],
        fixed_covariance=None if sigma is None else scale**2 * sigma[order],
    )
    here = transform(again.fixed_from_moving, scale * (moving - far)) / scale - far
    np.testing.assert_allclose(here, transform(base.fixed_from_moving, moving), atol=1e-7)
    assert again.fre_mm == pytest.approx(scale * base.fre_mm, rel=1e-9)
    assert float(again.tre(scale * (fixed[0] + far))) == pytest.approx(scale * float(base.tre(fixed[0])), rel=1e-6)


CHILD = """
import hashlib, sys
import numpy as np
import registration

data = np.load(sys.argv[1])
model = registration.prepare_model(data["vertices"], data["faces"])
robust = registration.register(data["points"], model, grid=data["grid"])
settings = registration.DissertationSettings(max_iterations=10, suppression_runs=1)
start = robust.model_from_scanner
old = registration.register(data["points"], model, start=start, method="dissertation", settings=settings)
found = [a for r in (robust, old) for a in (r.model_from_scanner, r.covariance, r.residuals, r.inliers)]
print(hashlib.sha256(b"".join(a.tobytes() for a in found)).hexdigest())
"""


def test_the_same_bits_with_any_number_of_threads_and_with_a_fresh_cache(
    socket: registration.Model, scan_of: Callable[..., Any], tmp_path: Path
) -> None:
    scan = scan_of(socket, 6, n=36)
    file = tmp_path / "scan.npz"
    np.savez(file, points=scan.points, grid=scan.grid, vertices=socket.vertices, faces=socket.faces)
    digests = set()
    for threads in ("1", "2", "4"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        env = {**os.environ, **dict.fromkeys(names, threads)}
        if threads == "4":
            env["PICORADAR_CACHE"] = str(tmp_path)
        out = subprocess.run(
            [sys.executable, "-c", CHILD, str(file)], env=env, capture_output=True, text=True, check=True
        )
        digests.add(out.stdout.strip())
    assert len(digests) == 1
