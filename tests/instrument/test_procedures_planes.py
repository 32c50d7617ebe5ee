"""Plane-constrained calibration: derivatives, recovery among outliers, what cannot be known, condition numbers."""

from __future__ import annotations

import datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.instrument.calibration import Calibration, codes_to_angles
from picoradar.instrument.procedures.geometry import (
    DEFAULT_POSES,
    PARAMETERS,
    PlaneFit,
    PlaneScan,
    Pose,
    fit_planes,
    plane_of,
)
from picoradar.instrument.procedures.geometry.plane_fit import stacked
from picoradar.instrument.procedures.geometry.plane_poses import next_pose, synthetic
from picoradar.instrument.procedures.geometry.plane_words import in_words
from picoradar.instrument.procedures.geometry.planes import PLANE_SIZES, SIZES, FloatArray, beams, fitted_plane

NOISE_MM = 0.05
BEFORE = Calibration(
    date=datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC),
    provenance="test",
    mirror_separation_mm=30.0,
    pointing_sd_rad=1e-6,
)
TRUE = np.array([31.2, 0.006, -0.004, 0.004, 0.0, 0.002, 0.7])
Y_OFFSET = PARAMETERS.index("y_offset_rad")


def raster(side: int = 12) -> FloatArray:
    codes = 2048 + np.round(np.linspace(-1638, 1638, side)).astype(np.int64)
    y, x = np.meshgrid(codes, codes, indexing="ij")
    return codes_to_angles(np.column_stack([x.ravel(), y.ravel()]), 10.0)


def scan_of(pose: Pose, rng: np.random.Generator, outliers: float = 0.0) -> PlaneScan:
    asked = raster()
    ranges = synthetic(pose, TRUE, asked) - TRUE[6] + rng.normal(0, NOISE_MM, len(asked))
    gross = rng.random(len(asked)) < outliers
    ranges[gross] += rng.uniform(-30, 30, int(gross.sum()))
    return PlaneScan(asked, ranges, np.full(len(asked), NOISE_MM**2), pose.distance_mm if pose.square else None)


def calibrated(seed: int, outliers: float = 0.05, poses: tuple[Pose, ...] = DEFAULT_POSES) -> PlaneFit:
    rng = np.random.default_rng(seed)
    return fit_planes([scan_of(pose, rng, outliers) for pose in poses], BEFORE)


@settings(max_examples=10, deadline=None)
@given(st.floats(650, 1000), st.floats(-50, 50), st.floats(-50, 50), st.integers(0, 2**16))
def test_the_derivatives_are_those_of_the_residuals(distance_mm: float, rx: float, ry: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = Pose(distance_mm, (rx, ry))
    scan, plane = scan_of(pose, rng), plane_of(pose)
    # On the plane: off it, the derivatives are taken where the beam meets the plane, on purpose.
    exact = PlaneScan(scan.angles_rad, synthetic(pose, TRUE, scan.angles_rad), scan.variance_mm2)
    seen = beams(exact, TRUE, plane, TRUE[6])
    np.testing.assert_allclose(seen.off_mm, 0, atol=1e-9)
    for number, step in enumerate(1e-4 * SIZES):
        moved = TRUE + step * np.eye(7)[number]
        np.testing.assert_allclose(
            seen.by_values[:, number] * step, beams(exact, moved, plane, TRUE[6]).off_mm, atol=2e-6 + 1e-3 * step
        )
    for number, step in enumerate(1e-4 * PLANE_SIZES):
        moved = plane + step * np.eye(3)[number]
        np.testing.assert_allclose(
            seen.by_plane[:, number] * step, beams(exact, TRUE, moved, TRUE[6]).off_mm, atol=2e-6 + 1e-3 * step
        )


@pytest.mark.parametrize("seed", [1, 2])
def test_hidden_errors_are_found_among_gross_outliers(seed: int) -> None:
    fit = calibrated(seed)
    off = (fit.values - TRUE) / fit.sd
    assert np.all(np.abs(off[fit.identified]) < 4), dict(zip(PARAMETERS, off, strict=True))
    assert fit.noise_factor == pytest.approx(1.0, abs=0.06)
    assert 0.93 < fit.inliers.mean() < 0.97
    assert fit.sd_mm >= fit.rms_mm


def test_a_turn_of_the_whole_frame_is_said_to_be_unknown_and_not_returned() -> None:
    fit = calibrated(4)
    assert not fit.identified[Y_OFFSET]
    assert fit.values[Y_OFFSET] == 0.0
    assert fit.identified.sum() == 6
    assert "do not identify" in in_words(fit)[Y_OFFSET]


def test_the_calibration_made_carries_the_covariance_of_what_is_known() -> None:
    fit = calibrated(4)
    made = fit.applied_to(BEFORE)
    assert made.geometry is not None
    known = [name for name, found in zip(PARAMETERS, fit.identified, strict=True) if found]
    assert list(made.geometry.parameters) == known
    np.testing.assert_allclose(list(made.geometry.sd.values()), fit.sd[fit.identified])
    assert Calibration.from_json(made.model_dump_json(), "test") == made
    assert "range_zero_mm" not in made.geometry.without("range_zero_mm").sd


def test_one_square_pose_does_not_tell_separation_and_offsets_and_a_tilted_one_is_advised() -> None:
    poses = (Pose(800.0),)
    fit = calibrated(5, poses=poses)
    unknown = {name for name, known in zip(PARAMETERS, fit.identified, strict=True) if not known}
    assert {"mirror_separation_mm", "x_offset_rad", "y_offset_rad"} <= unknown
    assert fit.values[0] == BEFORE.mirror_separation_mm
    advised, sd = next_pose(fit, BEFORE, raster(), NOISE_MM)
    assert advised.tilt_deg != (0.0, 0.0)
    assert np.all(sd <= fit.sd * (1 + 1e-9))


def test_condition_numbers_agree_with_those_of_a_numerically_differentiated_residual() -> None:
    rng = np.random.default_rng(6)
    scans = [scan_of(pose, rng) for pose in DEFAULT_POSES]
    fit = fit_planes(scans, BEFORE)
    values = np.where(fit.identified, fit.values, 0.0)
    vector = np.concatenate([values, fit.planes.ravel()])
    sizes = np.concatenate([SIZES, np.tile(PLANE_SIZES, len(scans))])
    kept = np.concatenate([fit.identified, np.ones(fit.planes.size, dtype=bool)])
    columns = []
    for number in np.flatnonzero(kept):
        step = 1e-4 * sizes[number] * np.eye(len(vector))[number]
        ahead, back = (stacked(scans, vector + sign * step, 0.0)[0] for sign in (1, -1))
        columns.append((ahead - back)[fit.inliers] / (2e-4 * sizes[number]))
    derivative = np.column_stack(columns)
    for found, scale in ((fit.condition, np.ones(kept.sum())), (fit.condition_scaled, sizes[kept])):
        singular = np.linalg.svd(derivative * scale, compute_uv=False)
        assert found == pytest.approx(singular[0] / singular[-1], rel=0.01)
    assert fit.condition_scaled < fit.condition


def test_a_plane_is_found_among_outliers() -> None:
    rng = np.random.default_rng(7)
    xy = rng.uniform(-50, 50, (300, 2))
    where = np.column_stack([xy, 800 + 0.3 * xy[:, 0] - 0.1 * xy[:, 1] + rng.normal(0, 0.05, 300)])
    where[:30, 2] += 20
    a, b, offset = fitted_plane(where)
    assert (a, b) == (pytest.approx(0.3, abs=2e-3), pytest.approx(-0.1, abs=2e-3))
    assert offset == pytest.approx(800 / np.sqrt(1 + 0.09 + 0.01), abs=0.05)
