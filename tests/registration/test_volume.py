"""Surface points of a CT volume, and their registration by the same solvers as laser scans."""

from __future__ import annotations

import gzip
import importlib.util
from pathlib import Path
from types import ModuleType

import igl
import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.model import Surface
from picoradar.registration.preoperative import surface_points
from picoradar.registration.preoperative.volume import two_gaussians
from picoradar.registration.se3 import pose, rotation_from_vector, transform

ROOT = Path(__file__).parents[2]
REAL_CT = ROOT.parent / "shared" / "data" / "totalseg-example-ct"


def test_two_gaussians_are_found() -> None:
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(50.0, 20.0, 30_000), rng.normal(800.0, 100.0, 10_000)])
    found = two_gaussians(values)
    np.testing.assert_allclose(found.share, [0.75, 0.25], atol=0.01)
    np.testing.assert_allclose(found.mean, [50.0, 800.0], atol=5.0)
    np.testing.assert_allclose(found.sd, [20.0, 100.0], rtol=0.05)
    assert found.halfway == pytest.approx(425.0, abs=5.0)
    at = found.densities(np.array([found.equally_probable]))[0]
    assert at[0] == pytest.approx(at[1], rel=0.5)


def test_points_lie_where_the_intensity_crosses_in_the_frame_of_the_affine() -> None:
    ramp = np.broadcast_to(np.arange(8.0)[:, None, None], (8, 3, 3)) * 100.0
    affine = np.diag([2.0, 3.0, 4.0, 1.0])
    affine[:3, 3] = [10.0, 20.0, 30.0]
    points = surface_points(ramp, affine, 325.0)
    assert len(points) == 9
    np.testing.assert_allclose(points[:, 0], 10.0 + 2.0 * 3.25)
    np.testing.assert_allclose(np.unique(points[:, 1]), [20.0, 23.0, 26.0])


@pytest.mark.parametrize(
    ("volume", "message"),
    [
        (np.zeros((4, 4)), "three-dimensional"),
        (np.full((4, 4, 4), np.nan), "finite"),
        (np.ones((4, 4, 4)), "all the same"),
    ],
)
def test_volumes_without_a_surface_are_refused(volume: np.ndarray, message: str) -> None:
    with pytest.raises(registration.PointsError, match=message):
        surface_points(volume, np.eye(4))


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("register_ct", ROOT / "docs" / "examples" / "register_ct.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_registers_a_ct_both_ways(example: ModuleType) -> None:
    model = registration.load_model(example.HIP)
    socket = model.views[0]
    volume, affine, truth = example.made_up_ct(model, socket.centre, voxel_mm=2.0, size=36)
    points = surface_points(volume, affine)
    off = pose(rotation_from_vector(np.radians([5.0, -4.0, 4.0])), np.array([3.0, -4.0, 3.0]))
    start = pose(np.eye(3), socket.centre) @ off @ pose(np.eye(3), -socket.centre) @ truth
    towards = start[:3, :3].T @ socket.axis
    for found in (
        example.by_distance_field(points, model.surface, start),
        example.by_front_door(points, model, start, towards),
    ):
        error = registration.pose_error(found, truth, socket.centre)
        assert error.rotation_deg < 0.3
        assert error.translation_mm < 0.3


def read_nifti(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Voxels and affine of a gzipped NIfTI-1 file with an sform."""
    raw = gzip.decompress(path.read_bytes())
    shape = np.frombuffer(raw, "<i2", 3, 42)
    kind = {2: "<u1", 4: "<i2", 8: "<i4", 16: "<f4", 64: "<f8"}[int(np.frombuffer(raw, "<i2", 1, 70)[0])]
    offset = int(np.frombuffer(raw, "<f4", 1, 108)[0])
    affine = np.vstack([np.frombuffer(raw, "<f4", 12, 280).reshape(3, 4), [0, 0, 0, 1]]).astype(np.float64)
    return np.frombuffer(raw, kind, int(np.prod(shape)), offset).reshape(shape, order="F").astype(np.float64), affine


def test_a_real_ct_registers_to_the_model_segmented_from_it(example: ModuleType) -> None:
    """The voxels are 3 mm and the mask is a network's, so that a millimetre is what can be asked."""
    if not REAL_CT.is_dir():
        pytest.skip(reason=f"{REAL_CT} is not here: the real CT is not registered")
    volume, affine = read_nifti(REAL_CT / "example_ct.nii.gz")
    mask, _ = read_nifti(REAL_CT / "hip_right.nii.gz")
    low, high = (np.array(f(np.nonzero(mask), axis=1)) for f in (np.min, np.max))
    low, high = np.maximum(low - 3, 0), np.minimum(high + 4, mask.shape)
    crop = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    shift = pose(np.eye(3), low.astype(np.float64))
    size = np.array(mask[crop].shape)
    index = np.stack(np.meshgrid(*[np.arange(n, dtype=float) for n in size[::-1]], indexing="ij"), -1).reshape(-1, 3)
    vertices, faces, _ = igl.marching_cubes(
        mask[crop].ravel(order="F") - 0.5, index[:, ::-1].copy(), *size.tolist(), 0.0
    )
    surface = Surface(transform(affine @ shift, vertices), faces[:, ::-1])
    points = surface_points(np.clip(volume[crop], -200.0, 1200.0), affine @ shift)
    points = points[::3][surface.distances(points[::3]) < 4.0]
    off = pose(rotation_from_vector(np.radians([4.0, -4.0, 3.0])), np.array([3.0, -4.0, 3.0]))
    middle = points.mean(axis=0)
    start = pose(np.eye(3), middle) @ off @ pose(np.eye(3), -middle)
    error = registration.pose_error(example.by_distance_field(points, surface, start), np.eye(4), middle)
    assert error.rotation_deg < 1.0
    assert error.translation_mm < 1.5
