"""Light in tissue: the shipped table against exact theory and independent figures, and what comes out of the bench.

The figures "of the sheet" are from an independent Monte Carlo of the same model (300,000 photons; errors 0.2 % of the
radiance factor, 0.01 to 0.1 ps of a shift), with a stand-in for the receiver's pulse.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from picoradar.sim.physics.tissue_light import Optical, monte_carlo, on_grid, shipped_table, time_response
from picoradar.sim.physics.tissue_light.optical import BLOOD, CARTILAGE, CORTICAL_BONE, FAT, MUSCLE, paint_inside

MM_PER_PS = 0.149896
T_PS = np.arange(-500.0, 7000.0)
ECHO = norm.cdf(T_PS / 81.9) * (1 - norm.cdf((T_PS - 600) / 117))


def edges_ps(echo):
    """50 % point, rise from 10 to 90 %, and fall from 90 to 10 % of an echo."""
    peak = int(echo.argmax())
    up = np.interp(np.array([0.1, 0.5, 0.9]) * echo[peak], echo[: peak + 1], T_PS[: peak + 1])
    down = np.interp(np.array([-0.9, -0.1]) * echo[peak], -echo[peak:], T_PS[peak:])
    return np.array([up[1], up[2] - up[0], down[1] - down[0]])


def change_ps(optical, view_mm, angle_deg=0.0, surface_share=0.0):
    """How the 50 % point, the rise and the fall of the stand-in change, for a spot of 1 mm; and the radiance factor."""
    response = time_response(optical, angle_deg, view_mm, 0.5)
    late = on_grid(response, 1.0, surface_share).astype(np.float64)
    return edges_ps(np.convolve(ECHO, late)[: len(T_PS)]) - edges_ps(ECHO), response.beta


@pytest.mark.parametrize(("albedo", "exact"), [(0.5, 0.09785), (0.8, 0.25543), (0.9, 0.38507), (0.95, 0.51234)])
def test_radiance_back_along_the_beam_is_that_of_chandrasekhar(albedo, exact):
    """Without a step of the index: w / 8 H(1)^2, exact for isotropic scattering. Absorption only weights the paths."""
    rng = np.random.default_rng(11)
    absorption = 1 / albedo - 1
    beta = sum(
        float(np.sum(seen.weight * np.exp(-absorption * seen.path)))
        for seen in monte_carlo.follow(1.0, 0.0, 20_000, rng)
    )
    assert beta == pytest.approx(exact, rel=0.015)


@pytest.mark.parametrize(
    ("path", "all_light", "discs"),
    [
        (2, 0.1021, (0.0832, 0.0976, 0.1021, 0.1021)),
        (8, 0.2861, (0.1124, 0.1616, 0.2322, 0.2851)),
        (64, 0.6674, (0.1167, 0.1784, 0.2933, 0.5153)),
        (512, 0.8920, (0.1170, 0.1796, 0.2981, 0.5443)),
    ],
)
def test_shipped_table_is_the_kernel_of_the_sheet(path, all_light, discs):
    table = shipped_table()
    so_far = table.at(1.4, 0.0).cumsum(axis=0).cumsum(axis=1)
    assert np.interp(path, table.path_edges[1:], so_far[:, -1]) == pytest.approx(all_light, rel=0.006)
    for radius, expected in zip((0.5, 1.0, 2.0, 5.0), discs, strict=True):
        within = [np.interp(radius, table.radius_edges[1:-1], row[:-1]) for row in so_far]
        assert np.interp(path, table.path_edges[1:], within) == pytest.approx(expected, rel=0.008)


@pytest.mark.parametrize(
    ("optical", "view_mm", "beta", "shift_ps"),
    [
        (Optical("S1", 2.0, 0.03, 1.4), 0.5, 0.152, 7.35),
        (Optical("S1", 2.0, 0.03, 1.4), 3.0, 0.477, 24.2),
        (Optical("S2", 1.2, 0.025, 1.4), 1.0, 0.183, 12.46),
        (Optical("S2", 1.2, 0.025, 1.4), 10.0, 0.506, 42.4),
        (Optical("S3", 0.8, 0.05, 1.4), 3.0, 0.240, 22.5),
        (Optical("S3", 0.8, 0.05, 1.4), 10.0, 0.333, 36.2),
    ],
)
def test_shift_of_the_50_percent_point_is_that_of_the_sheet(optical, view_mm, beta, shift_ps):
    change, found = change_ps(optical, view_mm)
    assert found == pytest.approx(beta, rel=0.012)
    assert change[0] == pytest.approx(shift_ps, abs=0.25)


@pytest.mark.parametrize(
    ("optical", "expected"),
    [
        (CORTICAL_BONE, (27.7, 15.4, 11.7)),
        (CARTILAGE, (24.0, 10.7, 7.8)),
        (FAT, (31.8, 22.1, 20.5)),
        (MUSCLE, (25.2, 12.0, 8.9)),
        (BLOOD, (5.8, 0.5, 0.3)),
    ],
)
def test_shape_of_the_echo_changes_as_in_the_sheet(optical, expected):
    np.testing.assert_allclose(change_ps(optical, 3.0)[0], expected, atol=0.3)


@pytest.mark.parametrize(("view_mm", "bias_mm"), [(1.0, (2.00, 2.14, 2.40)), (3.0, (4.15, 4.32, 4.50))])
def test_bias_grows_with_the_angle_as_in_the_sheet(view_mm, bias_mm):
    found = [change_ps(CORTICAL_BONE, view_mm, angle)[0][0] * MM_PER_PS for angle in (0.0, 45.0, 63.0)]
    np.testing.assert_allclose(found, bias_mm, atol=0.04)


def test_light_of_the_surface_takes_bias_away():
    whole = change_ps(CORTICAL_BONE, 3.0)[0][0]
    for share, left in ((0.1, 0.89), (0.2, 0.79), (0.3, 0.68)):
        assert change_ps(CORTICAL_BONE, 3.0, surface_share=share)[0][0] / whole == pytest.approx(left, abs=0.01)


def test_paint_hardly_delays():
    white, gray = (change_ps(paint_inside(level), 3.0)[0][0] * MM_PER_PS for level in (0.9, 0.5))
    assert 0.0 < gray < white < 0.2


@given(
    scattering=st.floats(0.3, 300.0),
    absorbed=st.floats(0.0, 0.6),
    index=st.floats(1.33, 1.55),
    angle=st.floats(0.0, 75.0),
    view=st.floats(0.5, 20.0),
)
def test_a_response_has_sum_one_the_right_mean_and_no_light_before_the_surface(
    scattering, absorbed, index, angle, view
):
    response = time_response(Optical("any", scattering, absorbed * scattering, index), angle, view, 0.5)
    assert response.delay_ps.min() > 0
    assert response.weight.min() >= 0
    assert response.weight.sum() == pytest.approx(1.0)
    assert 0 < response.beta < 1.2
    grid = on_grid(response, 1.0, 0.25)
    assert grid.sum(dtype=np.float64) == pytest.approx(1.0, abs=1e-5)
    mean = 0.75 * float(response.delay_ps @ response.weight)
    # No more than 1e-4 of the light is left out, which comes at most 1000 / mu_s' of path late.
    assert np.arange(len(grid)) @ grid.astype(float) == pytest.approx(mean, abs=1e-4 * response.delay_ps.max() + 1e-3)


def test_lengths_scale_with_the_scattering():
    one = time_response(Optical("one", 1.0, 0.02, 1.45), 30.0, 3.0, 0.5)
    two = time_response(Optical("two", 2.0, 0.04, 1.45), 30.0, 1.5, 0.25)
    assert two.beta == pytest.approx(one.beta)
    np.testing.assert_allclose(two.delay_ps, one.delay_ps / 2)


def test_first_order_of_the_scattering_is_the_closed_form():
    """d beta / dx = (1 - R)^2 / (8 n^2) exp(-x) of single scattering bounds the kernel from below at early times."""
    table = shipped_table()
    x = table.path_edges[1:6]  # below 0.04 hardly any light has been scattered twice
    index = 1.5
    once = (1 - ((index - 1) / (index + 1)) ** 2) ** 2 / (8 * index**2) * -np.expm1(-x)
    found = table.at(index, 0.0).sum(axis=1).cumsum()[:5]
    assert np.all(found > once * 0.97)
    np.testing.assert_allclose(found, once, rtol=0.06)


def test_properties_that_no_material_has_are_refused():
    with pytest.raises(ValueError, match="vapour: needs scattering above 0"):
        Optical("vapour", 0.0, 0.1, 1.0)


def test_all_light_is_more_than_any_disc():
    betas = [time_response(CORTICAL_BONE, 0.0, view, 0.0).beta for view in (0.5, 1.0, 3.0, 10.0, math.inf)]
    assert np.all(np.diff(betas) > 0)


@pytest.mark.slow
@pytest.mark.parametrize(("i", "j"), [(1, 2), (4, 4), (5, 0)])
def test_the_script_makes_the_shipped_table_again(i, j):
    """Other photons, as many, same kernel within five standard errors of the difference, taken from 24 batches."""
    table, batches = shipped_table(), 24
    index, angle = monte_carlo.INDICES[i], monte_carlo.ANGLES_DEG[j]
    rngs = (np.random.default_rng([77, i, j, batch]) for batch in range(batches))
    runs = np.array([monte_carlo.kernel(index, angle, monte_carlo.PHOTONS // batches, rng) for rng in rngs])
    for other in (0, 1):  # over paths, over radii
        found = runs.sum(axis=1 + other).cumsum(axis=1)
        expected = table.kernel[i, j].sum(axis=other).cumsum()
        error = math.sqrt(2) * found.std(axis=0, ddof=1) / math.sqrt(batches)
        assert np.all(np.abs(found.mean(axis=0) - expected) < 5 * error)
