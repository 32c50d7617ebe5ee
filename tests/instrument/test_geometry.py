"""Two-mirror geometry: inverse, Jacobian, known places, codes, scanner errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.errors import LimitError
from picoradar.instrument.calibration import (
    ScannerErrors,
    angles_and_range,
    angles_to_codes,
    asked_angles,
    codes_to_angles,
    covariance_from,
    jacobian,
    points_from,
    true_angles,
)

angle = st.floats(-0.35, 0.35)
distance = st.floats(100.0, 2000.0)
separation = st.floats(0.0, 100.0)


def test_the_beam_at_rest_goes_along_z() -> None:
    np.testing.assert_allclose(points_from([[0.0, 0.0]], [900.0], 30.0), [[0.0, 0.0, 900.0]], atol=1e-12)


def test_positive_angles_deflect_to_positive_x_and_y() -> None:
    point = points_from([[0.05, 0.03]], [900.0], 30.0)[0]
    assert point[0] == pytest.approx(930.0 * np.sin(0.05))
    assert point[1] > 0


@settings(deadline=None, max_examples=60)
@given(tx=angle, ty=angle, rho=distance, e=separation)
def test_points_lead_back_to_angles_and_range(tx: float, ty: float, rho: float, e: float) -> None:
    angles, ranges = angles_and_range(points_from([[tx, ty]], [rho], e), e)
    np.testing.assert_allclose(angles, [[tx, ty]], atol=1e-12)
    np.testing.assert_allclose(ranges, [rho], rtol=1e-12)


@settings(deadline=None, max_examples=60)
@given(tx=angle, ty=angle, rho=distance, e=separation)
def test_the_jacobian_agrees_with_finite_differences(tx: float, ty: float, rho: float, e: float) -> None:
    h = np.array([1e-6, 1e-6, 1e-3])
    expected = np.empty((3, 3))
    for k in range(3):
        d = np.where(np.arange(3) == k, h, 0.0)
        ahead = points_from([[tx + d[0], ty + d[1]]], [rho + d[2]], e)[0]
        behind = points_from([[tx - d[0], ty - d[1]]], [rho - d[2]], e)[0]
        expected[:, k] = (ahead - behind) / (2 * h[k])
    np.testing.assert_allclose(jacobian([[tx, ty]], [rho], e)[0], expected, rtol=1e-6, atol=1e-5)


def test_covariance_is_that_of_drawn_points() -> None:
    rng = np.random.default_rng(3)
    n, sd = 200_000, 2e-4
    angles = np.array([0.08, -0.06]) + rng.normal(0, sd, (n, 2))
    drawn = np.cov(points_from(angles, 900.0 + rng.normal(0, 0.3, n), 30.0).T)
    predicted = covariance_from([[0.08, -0.06]], [900.0], [0.09], sd, 30.0)[0]
    np.testing.assert_allclose(predicted, drawn, atol=5 * predicted.max() / np.sqrt(n))


def test_missing_range_gives_nan_not_an_exception() -> None:
    assert np.isnan(points_from([[0.0, 0.0]], [np.nan], 30.0)).all()
    assert np.isnan(covariance_from([[0.01, 0.02]], [np.nan], [np.nan], 1e-5, 30.0)).all()


@settings(deadline=None, max_examples=60)
@given(code=st.integers(0, 4095), field=st.floats(0.5, 40.0))
def test_codes_lead_back_to_themselves(code: int, field: float) -> None:
    assert angles_to_codes(codes_to_angles(code, field), field) == code


def test_the_centre_code_is_no_deflection_and_a_quarter_is_a_quarter_of_the_field() -> None:
    assert codes_to_angles(0x800, 10.0) == 0.0
    assert codes_to_angles(0x400, 10.0) == pytest.approx(np.deg2rad(-2.5))


@pytest.mark.parametrize("degrees", [5.0, -5.01, float("nan")])
def test_an_angle_outside_the_span_is_refused_with_the_span(degrees: float) -> None:
    with pytest.raises(LimitError, match=r"outside its span of -5.000 to 4.998 deg"):
        angles_to_codes(np.deg2rad([0.0, degrees]), 10.0)


@pytest.mark.parametrize("code", [-1, 4096])
def test_a_code_outside_12_bits_is_refused(code: int) -> None:
    with pytest.raises(LimitError, match=str(code)):
        codes_to_angles([0, code], 10.0)


def test_scanner_errors_are_undone_by_what_is_asked_for() -> None:
    errors = ScannerErrors(
        x_scale=0.01, y_scale=-0.02, x_offset_rad=1e-3, y_offset_rad=-2e-3, non_orthogonality_rad=5e-3
    )
    wanted = np.random.default_rng(0).uniform(-0.08, 0.08, (20, 2))
    np.testing.assert_allclose(true_angles(asked_angles(wanted, errors), errors), wanted, atol=1e-15)
    np.testing.assert_allclose(true_angles([[0.1, 0.0]], errors), [[0.102, 5e-4 - 2e-3]])
