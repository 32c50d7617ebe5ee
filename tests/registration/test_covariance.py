"""What a registration is worth: quantiles, stiffness, shared misfit and words, on cases with known answers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import chdtri

from picoradar.registration.scan import MIN_POINTS
from picoradar.registration.trust.budget import Socket
from picoradar.registration.trust.covariance import (
    chi_square_quantile,
    patch_misfit_mm,
    quantile_mm,
    stiffness,
)
from picoradar.registration.trust.evidence import Tolerance
from picoradar.registration.trust.words import describe_weakness


def clumps(count: int, size: int = 9) -> np.ndarray:
    """Neighbours (N, 8) of points in clumps in which each is beside all others."""
    total = count * size
    around = np.full((total, 8), total)
    for k in range(total):
        first = k - k % size
        beside = [j for j in range(first, first + size) if j != k]
        around[k, : len(beside)] = beside
    return around


def test_what_neighbours_share_is_the_root_of_their_covariance() -> None:
    around = clumps(2 * MIN_POINTS)
    shift = np.repeat(np.tile([0.3, -0.5], MIN_POINTS), 9)
    everything = np.ones(len(shift), dtype=bool)
    assert patch_misfit_mm(shift, everything, around, 3) == pytest.approx(np.sqrt(0.17))


def test_outliers_neither_count_nor_speak_for_their_neighbours() -> None:
    around = clumps(MIN_POINTS)
    residuals, inliers = np.full(len(around), 0.3), np.ones(len(around), dtype=bool)
    residuals[::9], inliers[::9] = 50.0, False
    assert patch_misfit_mm(residuals, inliers, around, 7) == pytest.approx(0.3)  # seven inliers beside each
    assert patch_misfit_mm(residuals, inliers, around, 8) == 0.0


def test_too_few_points_share_nothing_that_can_be_told() -> None:
    around = np.full((MIN_POINTS, 8), MIN_POINTS)
    around[:, 0] = (np.arange(MIN_POINTS) + 1) % MIN_POINTS
    residuals, inliers = np.full(MIN_POINTS, 0.3), np.ones(MIN_POINTS, dtype=bool)
    assert patch_misfit_mm(residuals, inliers, around, 1) == pytest.approx(0.3)
    inliers[0] = False
    assert patch_misfit_mm(residuals, inliers, around, 0) == 0.0


def test_neighbours_that_disagree_share_nothing() -> None:
    around = clumps(MIN_POINTS, size=2)
    residuals = np.tile([0.3, -0.3], MIN_POINTS)
    assert patch_misfit_mm(residuals, np.ones(len(residuals), dtype=bool), around, 1) == 0.0


def test_stiffness_of_six_separate_motions() -> None:
    """Row i alone measures motion i: w_i a_i^2 / sum(w), rotations over the radius squared."""
    sizes = np.array([14.0, 10.0, 6.0, 2.0, 1.5, 1.0])
    sigma = np.array([1.0, 1.0, 1.0, 0.5, 1.0, 1.0])
    found = stiffness(np.diag(sizes), sigma, 2.0)
    np.testing.assert_allclose(found.eigenvalues, np.array([1.0, 2.25, 9.0, 16.0, 25.0, 49.0]) / 9.0)
    assert np.abs(found.motions).argmax(axis=0).tolist() == [5, 4, 2, 3, 1, 0]
    assert found.radius_mm == 2.0
    flat = stiffness(np.ones((7, 6)) * np.pi, np.full(7, 0.3), 0.7)
    assert flat.eigenvalues.min() == 0.0  # and not what rounding leaves below


def test_quantiles_of_one_and_three_equal_directions_are_exact() -> None:
    assert quantile_mm(np.diag([4.0, 0.0, 0.0])) == pytest.approx(2 * 1.959964, rel=1e-6)
    assert quantile_mm(np.eye(3)) == pytest.approx(np.sqrt(7.814728), rel=1e-6)
    assert quantile_mm(np.eye(3), 0.5) == pytest.approx(np.sqrt(2.365974), rel=1e-6)
    assert quantile_mm(1e-4 * np.eye(3)) == pytest.approx(0.01 * np.sqrt(7.814728), rel=1e-6)
    assert quantile_mm(np.zeros((3, 3))) == 0.0


def test_quantiles_between_follow_the_three_cumulants() -> None:
    """Of 1 and 4: 5, 34 and 520."""
    degrees = 8 * 34.0**3 / 520.0**2
    expected = 5.0 + (chdtri(degrees, 0.05) - degrees) * np.sqrt(34.0 / (2 * degrees))
    assert quantile_mm(np.diag([1.0, 4.0, 0.0])) == pytest.approx(np.sqrt(expected), rel=1e-9)


CENTRE, RADIUS_MM, CLINIC = np.array([1.0, 2.0, 3.0]), 10.0, Tolerance(1.0, 1.0)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (
            [0.0, 0.0, 0.0, 0.0, 0.6, 0.8],
            "free to slide: +-2 mm (95 %), the limit is 1 mm; sliding along (+0.00, +0.60",
        ),
        (
            [0.0, 0.0, 0.0, 0.0, 0.3, 0.4],
            "held; may slide: +-0.98 mm (95 %), the limit is 1 mm; sliding along (+0.00, ",
        ),
        ([0.019, 0.0, 0.0, 0.0, -0.95, 0.0], "free to slide: +-1.9 mm (95 %)"),
        (
            [0.02, 0.0, 0.0, 0.0, 0.0, 0.1],
            "free to rotate about one axis: +-2.2 deg (95 %), the limit is 1 deg; turning",
        ),
        ([0.02, 0.0, 0.0, 0.0, 0.0, 0.1], "turning about the axis (+1.00, +0.00, +0.00) through (1.0, -3.0, 3.0) mm"),
        ([0.0, 0.0, 0.1, 0.0, -0.5, 0.0], "turning about the axis (+0.00, +0.00, +1.00) through (6.0, 2.0, 3.0) mm"),
        ([0.0, 0.0, 0.008, 0.0, 0.0, 0.0], "held; may rotate about one axis: +-0.9 deg (95 %)"),
        ([0.0, 0.0, 0.1, 0.0, 0.0, 0.21], "through (1.0, 2.0, 3.0) mm, advancing 13 mm a turn"),
        ([0.0, 0.0, 0.1, 0.0, 0.0, -0.21], "through (1.0, 2.0, 3.0) mm, advancing -13 mm a turn"),
    ],
)
def test_motions_in_words(motion: list[float], words: str) -> None:
    assert words in describe_weakness(np.array(motion), CENTRE, RADIUS_MM, CLINIC)


def test_a_small_pitch_is_not_worth_a_word() -> None:
    assert "advancing" not in describe_weakness(np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.19]), CENTRE, RADIUS_MM, CLINIC)


@pytest.mark.parametrize(
    ("centre", "axis", "name"),
    [
        ([1.0, -3.0, 3.0], [1.0, 0.0, 0.0], "free to rotate about the socket's axis: +-2.2 deg (95 %), the limit is 1"),
        ([40.0, 1.9, 3.0], [-1.0, 0.0, 0.0], "about the socket's axis"),  # anywhere along it, 4.9 mm beside
        ([1.0, -3.0, 3.0], [0.0, 1.0, 0.0], "about the socket's centre"),
        ([1.0, 2.1, 3.0], [1.0, 0.0, 0.0], "about one axis"),
    ],
)
def test_an_axis_has_the_name_of_the_socket_that_it_passes(centre: list[float], axis: list[float], name: str) -> None:
    socket = Socket(np.array(centre), 26.0, np.array(axis), np.zeros((0, 3)))
    motion = np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.1])  # about x, through (1, -3, 3)
    assert name in describe_weakness(motion, CENTRE, RADIUS_MM, CLINIC, [socket])


def test_the_chi_square_quantile_of_few_degrees() -> None:
    """Where the cube-root form, from which it begins, is negative; by SciPy's chdtri."""
    assert chi_square_quantile(0.1, 0.5) == pytest.approx(1.1147756881492586e-06, rel=1e-9)
